// The oracle for rule=thin and rule=center: an independent, naive formulation in exact rational
// numbers. A triangle is cut by the plane x = X through a line's points, which gives a segment, and
// that by y = Y, which gives what triangle and line have in common; the voxelizer evaluates sides
// and planes instead, and has cases for triangles that are seen edge-on. Which of two triangles has
// the centre on a common side is decided by moving the line by (e, e^2) for an infinitesimal e;
// the voxelizer has the signs of the top-left rule.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {

using Snapped = std::array<std::array<int64_t, 3>, 3>;  // corners in 1/512 voxel, odd

// Whether the triangle occupies the cell by rule=thin or rule=center.
bool occupies_thin(const Snapped& triangle_512, const std::array<int, 3>& cell);
bool occupies_center(const Snapped& triangle_512, const std::array<int, 3>& cell);

// All cells of the grid by a rule, as touched_cells().
Occupancy thin_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid);
Occupancy center_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid);

// Whether no path of steps between cells that share a side, over cells that are not occupied, leads
// from `from` to a cell at the grid's border. `from` is not occupied.
bool is_enclosed(const Occupancy& occupancy, const OracleGrid& grid,
                 const std::array<int, 3>& from);

}  // namespace voxeld::reference
