#include "tests/reference/touch_oracle.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace voxeld::reference {
namespace {

using Wide = __int128;
using WideVector = std::array<Wide, 3>;

constexpr int64_t kCell = 512;  // units of 1/512 voxel

WideVector wide_cross(const WideVector& a, const WideVector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Wide wide_dot(const WideVector& a, const WideVector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// True when the projections of the three vertices and of the eight corners have no common point.
bool separates(const WideVector& axis, const std::array<WideVector, 3>& triangle,
               const WideVector& corner) {
  Wide triangle_min = wide_dot(axis, triangle[0]), triangle_max = triangle_min;
  for (int i = 1; i < 3; ++i) {
    const Wide d = wide_dot(axis, triangle[i]);
    triangle_min = std::min(triangle_min, d);
    triangle_max = std::max(triangle_max, d);
  }
  Wide cube_min = 0, cube_max = 0;
  for (int i = 0; i < 8; ++i) {
    const WideVector p = {corner[0] + ((i & 1) != 0 ? kCell : 0),
                          corner[1] + ((i & 2) != 0 ? kCell : 0),
                          corner[2] + ((i & 4) != 0 ? kCell : 0)};
    const Wide d = wide_dot(axis, p);
    cube_min = i == 0 ? d : std::min(cube_min, d);
    cube_max = i == 0 ? d : std::max(cube_max, d);
  }
  return triangle_max < cube_min || cube_max < triangle_min;
}

}  // namespace

int64_t snap_512(double p_grid, int dim) {
  if (p_grid >= -1.0 / 4096 && p_grid < 0) return 1;
  if (p_grid >= dim && p_grid <= dim + 1.0 / 4096) return int64_t{dim} * kCell - 1;
  return 2 * static_cast<int64_t>(std::floor(p_grid * 256)) + 1;
}

bool touches(const std::array<std::array<int64_t, 3>, 3>& triangle_512,
             const std::array<int, 3>& cell) {
  std::array<WideVector, 3> triangle;
  for (int i = 0; i < 3; ++i) {
    triangle[i] = {triangle_512[i][0], triangle_512[i][1], triangle_512[i][2]};
  }
  const WideVector corner = {Wide{cell[0]} * kCell, Wide{cell[1]} * kCell, Wide{cell[2]} * kCell};
  std::array<WideVector, 3> edges;
  for (int i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) edges[i][c] = triangle[(i + 1) % 3][c] - triangle[i][c];
  }
  const std::array<WideVector, 3> unit = {WideVector{1, 0, 0}, WideVector{0, 1, 0},
                                          WideVector{0, 0, 1}};
  for (const WideVector& axis : unit) {
    if (separates(axis, triangle, corner)) return false;
  }
  if (separates(wide_cross(edges[0], edges[1]), triangle, corner)) return false;
  for (const WideVector& edge : edges) {
    for (const WideVector& axis : unit) {
      if (separates(wide_cross(edge, axis), triangle, corner)) return false;
    }
  }
  return true;
}

Occupancy touched_cells(const std::vector<Triangle>& triangles, const OracleGrid& grid) {
  Occupancy cells(static_cast<size_t>(grid.dims[0]) * grid.dims[1] * grid.dims[2]);
  for (const Triangle& triangle : triangles) {
    std::array<std::array<int64_t, 3>, 3> snapped{};
    std::array<int, 3> first{}, last{};
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 3; ++i) {
        const double p_grid = (triangle[i][c] - grid.origin[c]) / grid.voxel_size[c];
        snapped[i][c] = snap_512(p_grid, grid.dims[c]);
      }
      const auto [low, high] = std::minmax({snapped[0][c], snapped[1][c], snapped[2][c]});
      // One cell more on each side than needed: the test decides, not the loop.
      first[c] = static_cast<int>(std::max<int64_t>(0, low / kCell - 1));
      last[c] = static_cast<int>(std::min<int64_t>(grid.dims[c] - 1, high / kCell + 1));
    }
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) {
          uint8_t& cell = cells[x + static_cast<size_t>(grid.dims[0]) *
                                        (y + static_cast<size_t>(grid.dims[1]) * z)];
          if (cell == 0 && touches(snapped, {x, y, z})) cell = 1;
        }
      }
    }
  }
  return cells;
}

size_t count(const Occupancy& occupancy) {
  return std::accumulate(occupancy.begin(), occupancy.end(), size_t{0});
}

}  // namespace voxeld::reference
