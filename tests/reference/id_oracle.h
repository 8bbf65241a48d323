// The oracle for channels of ids: how much surface of each id lies in each cell, in double
// precision. Each triangle is clipped to the cell's cube as a polygon, whose area is added up;
// nothing is shared with the voxelizer, which counts a lattice of integers.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {

using AreaById = std::map<int, double>;  // voxel^2

// ids: of each triangle. Keyed by x + dims.x * (y + dims.y * z); cells that are touched without
// area are absent. Triangles must lie within the grid.
std::map<size_t, AreaById> areas_by_id(const std::vector<Triangle>& triangles,
                                       const std::vector<int>& ids, const OracleGrid& grid);

}  // namespace voxeld::reference
