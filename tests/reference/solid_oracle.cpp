#include "tests/reference/solid_oracle.h"

#include <cmath>
#include <deque>
#include <numbers>

namespace voxeld::reference {
namespace {

__extension__ using Wide = __int128;

constexpr int64_t kCellSide = 512;  // units of 1/512 voxel

size_t index_of(const OracleGrid& grid, const std::array<int, 3>& cell) {
  return cell[0] + static_cast<size_t>(grid.dims[0]) *
                       (cell[1] + static_cast<size_t>(grid.dims[1]) * cell[2]);
}

template <typename Visit>
void for_each_cell(const OracleGrid& grid, const Visit& visit) {
  for (int z = 0; z < grid.dims[2]; ++z) {
    for (int y = 0; y < grid.dims[1]; ++y) {
      for (int x = 0; x < grid.dims[0]; ++x) visit(std::array<int, 3>{x, y, z});
    }
  }
}

// Twice the signed area of (a, b, p) in the plane of two axes; where it is 0, its sign after p has
// moved by a little along the first axis and by far less along the second.
int side_of(const std::array<Wide, 2>& a, const std::array<Wide, 2>& b,
            const std::array<Wide, 2>& p) {
  const Wide area = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
  if (area != 0) return area > 0 ? 1 : -1;
  const Wide along_first = -(b[1] - a[1]), along_second = b[0] - a[0];
  if (along_first != 0) return along_first > 0 ? 1 : -1;
  return along_second > 0 ? 1 : along_second < 0 ? -1 : 0;
}

// +1 where the line down from the centre of the cell meets the triangle's underside (it faces
// down), -1 where it meets the upper side, 0 where it misses it or the triangle is edge-on. A
// centre on the triangle lies above it.
int crossing_below(const std::array<std::array<int64_t, 3>, 3>& triangle,
                   const std::array<int, 3>& cell, int axis) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  std::array<std::array<Wide, 2>, 3> flat;
  for (size_t i = 0; i < 3; ++i) flat[i] = {triangle[i][u], triangle[i][v]};
  const std::array<Wide, 3> centre = {cell[0] * kCellSide + kCellSide / 2,
                                      cell[1] * kCellSide + kCellSide / 2,
                                      cell[2] * kCellSide + kCellSide / 2};
  const std::array<Wide, 2> p = {centre[u], centre[v]};
  const int first = side_of(flat[0], flat[1], p);
  if (first == 0 || side_of(flat[1], flat[2], p) != first ||
      side_of(flat[2], flat[0], p) != first) {
    return 0;
  }
  // Barycentric depth: areas of the three parts, all with the sign of the whole.
  const auto area = [](const auto& a, const auto& b, const auto& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  };
  const Wide whole = area(flat[0], flat[1], flat[2]);
  if (whole == 0) return 0;
  const Wide depth = area(flat[1], flat[2], p) * triangle[0][axis] +
                     area(flat[2], flat[0], p) * triangle[1][axis] +
                     area(flat[0], flat[1], p) * triangle[2][axis];
  const Wide sign = whole > 0 ? 1 : -1;
  if (centre[axis] * whole * sign < depth * sign) return 0;
  return whole > 0 ? -1 : 1;
}

}  // namespace

SnappedTriangles snap_triangles(const std::vector<Triangle>& triangles, const OracleGrid& grid) {
  SnappedTriangles snapped(triangles.size());
  for (size_t t = 0; t < triangles.size(); ++t) {
    for (size_t i = 0; i < 3; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        const double p_grid = (triangles[t][i][c] - grid.origin[c]) / grid.voxel_size[c];
        snapped[t][i][c] = snap_512(p_grid, grid.dims[c]);
      }
    }
  }
  return snapped;
}

Occupancy parity_cells(const SnappedTriangles& triangles, const OracleGrid& grid, int axis) {
  Occupancy inside(static_cast<size_t>(grid.dims[0]) * grid.dims[1] * grid.dims[2]);
  for_each_cell(grid, [&](const std::array<int, 3>& cell) {
    int crossings = 0;
    for (const auto& triangle : triangles) crossings += crossing_below(triangle, cell, axis) != 0;
    inside[index_of(grid, cell)] = crossings % 2;
  });
  return inside;
}

Occupancy nonzero_cells(const SnappedTriangles& triangles, const OracleGrid& grid) {
  Occupancy inside(static_cast<size_t>(grid.dims[0]) * grid.dims[1] * grid.dims[2]);
  for_each_cell(grid, [&](const std::array<int, 3>& cell) {
    int winding = 0;
    for (const auto& triangle : triangles) winding += crossing_below(triangle, cell, 2);
    inside[index_of(grid, cell)] = winding != 0;
  });
  return inside;
}

Occupancy majority_cells(const SnappedTriangles& triangles, const OracleGrid& grid) {
  Occupancy votes = parity_cells(triangles, grid, 0);
  for (const int axis : {1, 2}) {
    const Occupancy more = parity_cells(triangles, grid, axis);
    for (size_t i = 0; i < votes.size(); ++i) votes[i] += more[i];
  }
  for (uint8_t& vote : votes) vote = vote >= 2;
  return votes;
}

Occupancy unreached_cells(const Occupancy& touched, const OracleGrid& grid) {
  Occupancy unreached(touched.size(), 1);
  std::deque<std::array<int, 3>> queue;
  const auto reach = [&](const std::array<int, 3>& cell) {
    const size_t i = index_of(grid, cell);
    if (touched[i] != 0 || unreached[i] == 0) return;
    unreached[i] = 0;
    queue.push_back(cell);
  };
  for_each_cell(grid, [&](const std::array<int, 3>& cell) {
    for (size_t c = 0; c < 3; ++c) {
      if (cell[c] == 0 || cell[c] == grid.dims[c] - 1) reach(cell);
    }
  });
  while (!queue.empty()) {
    const std::array<int, 3> cell = queue.front();
    queue.pop_front();
    for (size_t c = 0; c < 3; ++c) {
      for (const int step : {-1, 1}) {
        std::array<int, 3> next = cell;
        next[c] += step;
        if (next[c] >= 0 && next[c] < grid.dims[c]) reach(next);
      }
    }
  }
  return unreached;
}

Occupancy near_cells(const Occupancy& inside, const Occupancy& surface, double thickness,
                     const OracleGrid& grid) {
  std::vector<std::array<int, 3>> places;
  for_each_cell(grid, [&](const std::array<int, 3>& cell) {
    if (surface[index_of(grid, cell)] != 0) places.push_back(cell);
  });
  Occupancy near(inside.size());
  for_each_cell(grid, [&](const std::array<int, 3>& cell) {
    const size_t i = index_of(grid, cell);
    if (inside[i] == 0) return;
    for (const auto& place : places) {
      long double squared = 0;
      for (size_t c = 0; c < 3; ++c) {
        squared += static_cast<long double>(cell[c] - place[c]) * (cell[c] - place[c]);
      }
      if (squared <= static_cast<long double>(thickness) * thickness) near[i] = 1;
    }
  });
  return near;
}

long double winding_number(const SnappedTriangles& triangles, const std::array<int, 3>& cell) {
  using Vector = std::array<long double, 3>;
  const auto dot = [](const Vector& a, const Vector& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  long double sum = 0;
  for (const auto& triangle : triangles) {
    std::array<Vector, 3> p;
    std::array<long double, 3> length{};
    for (size_t i = 0; i < 3; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        p[i][c] = static_cast<long double>(triangle[i][c] - cell[c] * kCellSide - kCellSide / 2) /
                  kCellSide;
      }
      length[i] = std::sqrt(dot(p[i], p[i]));
    }
    const Vector cross = {p[1][1] * p[2][2] - p[1][2] * p[2][1],
                          p[1][2] * p[2][0] - p[1][0] * p[2][2],
                          p[1][0] * p[2][1] - p[1][1] * p[2][0]};
    const long double below = length[0] * length[1] * length[2] + dot(p[0], p[1]) * length[2] +
                              dot(p[1], p[2]) * length[0] + dot(p[2], p[0]) * length[1];
    sum += 2 * std::atan2(dot(p[0], cross), below);
  }
  return sum / (4 * std::numbers::pi_v<long double>);
}

}  // namespace voxeld::reference
