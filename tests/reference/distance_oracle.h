// The oracle for distances: every cell against every triangle, every vertex, side and face of it on
// its own, in long double. It shares no code with the voxelizer.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "tests/reference/solid_oracle.h"

namespace voxeld::reference {

// From the centre of a cell to the nearest point of the triangles, in 1/512 of the unit in which
// the edges of a voxel have these lengths. There is one triangle or more.
long double surface_distance(const SnappedTriangles& triangles, const std::array<int, 3>& cell,
                             const std::array<double, 3>& edges = {1, 1, 1});

// The set cell whose centre is nearest to that of `cell`; of equally near ones the one with the
// lowest z, then y, then x. Nothing where no cell is set.
std::optional<std::array<int, 3>> nearest_cell(const Occupancy& set, const OracleGrid& grid,
                                               const std::array<int, 3>& cell);

}  // namespace voxeld::reference
