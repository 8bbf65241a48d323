// The oracle for rule=touch: an independent, naive formulation in exact integers. It shares no code
// with the voxelizer: snapping is written down again from server/voxel/README.md, and the overlap
// is the 13-axis separating axis test (Akenine-Moeller 2001) with all 8 cube corners projected in
// 128-bit integers, where the voxelizer uses Schwarz & Seidel's plane test and 2D projections.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace voxeld::reference {

using Point = std::array<double, 3>;
using Triangle = std::array<Point, 3>;  // world space

struct OracleGrid {
  std::array<int, 3> dims{};
  std::array<double, 3> origin{};
  std::array<double, 3> voxel_size{};
};

// One byte per cell, x fastest, then y, then z; 1 = occupied.
using Occupancy = std::vector<uint8_t>;

// Snapped coordinate of a grid-space coordinate, in 1/512 voxel: always odd.
int64_t snap_512(double p_grid, int dim);

// All cells that the closed snapped triangles touch. Triangles must lie within one cell of the grid
// (the oracle does not clip).
Occupancy touched_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid);

// The same for one triangle and one cell, snapped coordinates in 1/512 voxel.
bool touches(const std::array<std::array<int64_t, 3>, 3>& triangle_512,
             const std::array<int, 3>& cell);

size_t count(const Occupancy& occupancy);

}  // namespace voxeld::reference
