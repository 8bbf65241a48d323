// The oracle for fill=solid and fill=shell: what is inside of a mesh, from the definition in
// server/voxel/README.md and by the longest way: every cell against every triangle, in exact
// integers, without sweeps, bits or tiles. It shares no code with the voxelizer.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {

// Snapped coordinates in 1/512 voxel, all odd.
using SnappedTriangles = std::vector<std::array<std::array<int64_t, 3>, 3>>;

// As touched_cells() snaps, and beside the grid's box (by more than a cell) without its exceptions.
SnappedTriangles snap_triangles(const std::vector<Triangle>& triangles, const OracleGrid& grid);

// Cells with an odd number of crossings below their centre along the axis (0..2).
Occupancy parity_cells(const SnappedTriangles& triangles, const OracleGrid& grid, int axis);
// Cells with crossings along z below their centre that face up as often as down: not inside.
Occupancy nonzero_cells(const SnappedTriangles& triangles, const OracleGrid& grid);
// Two of three parities.
Occupancy majority_cells(const SnappedTriangles& triangles, const OracleGrid& grid);
// The cells that a flood from outside of the grid, through cells that are not set, does not reach.
Occupancy unreached_cells(const Occupancy& touched, const OracleGrid& grid);
// Cells of `inside` with a cell of `surface` at most `thickness` away, centre to centre.
Occupancy near_cells(const Occupancy& inside, const Occupancy& surface, double thickness,
                     const OracleGrid& grid);

// The generalized winding number at the centre of a cell: the sum of all solid angles, in long
// double.
long double winding_number(const SnappedTriangles& triangles, const std::array<int, 3>& cell);

}  // namespace voxeld::reference
