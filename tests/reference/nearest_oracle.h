// The oracle for color=nearest: which points of triangles are near to the centres of cells, in long
// double. Vertices, sides and faces of a triangle each on their own; the voxelizer sorts by sides.
#pragma once

#include <array>
#include <map>
#include <vector>

#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {

struct SurfacePoint {
  size_t triangle = 0;
  long double squared = 0;              // distance to the centre, voxel^2
  std::array<double, 3> barycentric{};  // in the triangle
};

// For every cell that triangles touch, the nearest point of each such triangle. Keyed by
// x + dims.x * (y + dims.y * z). Triangles must lie within the grid.
std::map<size_t, std::vector<SurfacePoint>> points_near_centres(
    const std::vector<Triangle>& triangles, const OracleGrid& grid);

}  // namespace voxeld::reference
