#include "tests/reference/id_oracle.h"

#include <algorithm>
#include <cmath>

namespace voxeld::reference {
namespace {

using PointPolygon = std::vector<Point>;

// The part of a polygon with side * (p[axis] - plane) >= 0.
PointPolygon cut(const PointPolygon& polygon, int axis, double plane, double side) {
  PointPolygon clipped;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point& a = polygon[i];
    const Point& b = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    const double above_a = side * (a[axis] - plane), above_b = side * (b[axis] - plane);
    if (above_a >= 0) clipped.push_back(a);
    if ((above_a < 0) == (above_b < 0)) continue;
    const double t = above_a / (above_a - above_b);
    Point crossing;
    for (int c = 0; c < 3; ++c) crossing[c] = a[c] + t * (b[c] - a[c]);
    clipped.push_back(crossing);
  }
  return clipped;
}

// Half the length of the sum of the cross products of the corners (the polygon is flat).
double polygon_area(const PointPolygon& polygon) {
  Point sum{};
  for (size_t i = 1; i + 1 < polygon.size(); ++i) {
    Point u, v;
    for (int c = 0; c < 3; ++c) {
      u[c] = polygon[i][c] - polygon[0][c];
      v[c] = polygon[i + 1][c] - polygon[0][c];
    }
    for (int c = 0; c < 3; ++c) {
      sum[c] += u[(c + 1) % 3] * v[(c + 2) % 3] - u[(c + 2) % 3] * v[(c + 1) % 3];
    }
  }
  return std::hypot(sum[0], sum[1], sum[2]) / 2;
}

}  // namespace

std::map<size_t, AreaById> areas_by_id(const std::vector<Triangle>& triangles,
                                       const std::vector<int>& ids, const OracleGrid& grid) {
  std::map<size_t, AreaById> cells;
  for (size_t t = 0; t < triangles.size(); ++t) {
    PointPolygon whole(3);
    std::array<int, 3> first{}, last{};
    for (int c = 0; c < 3; ++c) {
      for (size_t i = 0; i < 3; ++i) {
        const double p_grid = (triangles[t][i][c] - grid.origin[c]) / grid.voxel_size[c];
        whole[i][c] = static_cast<double>(snap_512(p_grid, grid.dims[c])) / 512;
      }
      const auto [low, high] = std::minmax({whole[0][c], whole[1][c], whole[2][c]});
      first[c] = std::max(static_cast<int>(std::floor(low)), 0);
      last[c] = std::min(static_cast<int>(std::floor(high)), grid.dims[c] - 1);
    }
    std::array<int, 3> cell{};
    for (cell[2] = first[2]; cell[2] <= last[2]; ++cell[2]) {
      for (cell[1] = first[1]; cell[1] <= last[1]; ++cell[1]) {
        for (cell[0] = first[0]; cell[0] <= last[0]; ++cell[0]) {
          PointPolygon inside = whole;
          for (int c = 0; c < 3; ++c) {
            inside = cut(cut(inside, c, cell[c], 1), c, cell[c] + 1, -1);
          }
          const double area = polygon_area(inside);
          if (area <= 0) continue;
          const auto row = static_cast<size_t>(cell[1]) +
                           static_cast<size_t>(grid.dims[1]) * static_cast<size_t>(cell[2]);
          cells[static_cast<size_t>(cell[0]) + static_cast<size_t>(grid.dims[0]) * row][ids[t]] +=
              area;
        }
      }
    }
  }
  return cells;
}

}  // namespace voxeld::reference
