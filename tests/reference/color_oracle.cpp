#include "tests/reference/color_oracle.h"

#include <algorithm>
#include <cmath>

namespace voxeld::reference {
namespace {

// A point of the clipped polygon with its barycentric coordinates in the whole triangle.
struct Corner {
  Point p;
  std::array<double, 3> bary;
};
using CornerPolygon = std::vector<Corner>;

Corner corner_between(const Corner& a, const Corner& b, double t) {
  Corner c;
  for (int i = 0; i < 3; ++i) {
    c.p[i] = a.p[i] + t * (b.p[i] - a.p[i]);
    c.bary[i] = a.bary[i] + t * (b.bary[i] - a.bary[i]);
  }
  return c;
}

// Keeps the part where sign * (p[axis] - plane) <= 0.
CornerPolygon clip(const CornerPolygon& polygon, int axis, double plane, double sign) {
  CornerPolygon out;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Corner& a = polygon[i];
    const Corner& b = polygon[(i + 1) % polygon.size()];
    const double da = sign * (a.p[axis] - plane);
    const double db = sign * (b.p[axis] - plane);
    if (da <= 0) out.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      out.push_back(corner_between(a, b, da / (da - db)));
    }
  }
  return out;
}

double triangle_area(const Point& a, const Point& b, const Point& c) {
  const Point u = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Point v = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  return 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                          u[0] * v[1] - u[1] * v[0]);
}

constexpr int kSubdivisionsMin = 6;  // 36 sample triangles per fan triangle

double length_of(const Point& a, const Point& b) {
  return std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
}

// Integrates the colour over the fan triangle (a, b, c).
void integrate(const Corner& a, const Corner& b, const Corner& c, size_t t, const ColorAt& color_at,
               double samples_per_voxel, CellColor& sum) {
  const double longest = std::max({length_of(a.p, b.p), length_of(b.p, c.p), length_of(c.p, a.p)});
  const int subdivisions =
      std::max(kSubdivisionsMin, static_cast<int>(std::ceil(longest * samples_per_voxel)));
  const double part = triangle_area(a.p, b.p, c.p) / (subdivisions * subdivisions);
  if (part <= 0) return;
  for (int i = 0; i < subdivisions; ++i) {
    for (int j = 0; j < 2 * (subdivisions - i) - 1; ++j) {
      // Centroids of the upright and the inverted small triangles of row i.
      const double shift = j % 2 == 0 ? 1.0 / 3 : 2.0 / 3;
      const double u = (i + shift) / subdivisions;
      const double v = (j / 2 + shift) / subdivisions;
      std::array<double, 3> bary{};
      for (int k = 0; k < 3; ++k) {
        bary[k] = a.bary[k] * (1 - u - v) + b.bary[k] * u + c.bary[k] * v;
      }
      const auto color = color_at(t, bary);
      for (int k = 0; k < 4; ++k) sum.linear_rgba[k] += part * color[k];
      sum.area += part;
    }
  }
}

}  // namespace

std::map<size_t, CellColor> average_colors(const std::vector<Triangle>& triangles,
                                           const OracleGrid& grid, const ColorAt& color_at,
                                           double samples_per_voxel) {
  std::map<size_t, CellColor> cells;
  for (size_t t = 0; t < triangles.size(); ++t) {
    CornerPolygon whole(3);
    std::array<int, 3> first{}, last{};
    for (int c = 0; c < 3; ++c) {
      double low = 1e300, high = -1e300;
      for (int i = 0; i < 3; ++i) {
        whole[i].p[c] = (triangles[t][i][c] - grid.origin[c]) / grid.voxel_size[c];
        whole[i].bary = {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0};
        low = std::min(low, whole[i].p[c]);
        high = std::max(high, whole[i].p[c]);
      }
      first[c] = std::clamp(static_cast<int>(std::floor(low)), 0, grid.dims[c] - 1);
      last[c] = std::clamp(static_cast<int>(std::floor(high)), 0, grid.dims[c] - 1);
    }
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) {
          CornerPolygon part = whole;
          const std::array<int, 3> cell = {x, y, z};
          for (int c = 0; c < 3 && part.size() >= 3; ++c) {
            part = clip(part, c, cell[c], -1);
            part = clip(part, c, cell[c] + 1, 1);
          }
          if (part.size() < 3) continue;
          CellColor& sum = cells[x + static_cast<size_t>(grid.dims[0]) *
                                         (y + static_cast<size_t>(grid.dims[1]) * z)];
          for (size_t i = 1; i + 1 < part.size(); ++i) {
            integrate(part[0], part[i], part[i + 1], t, color_at, samples_per_voxel, sum);
          }
        }
      }
    }
  }
  for (auto it = cells.begin(); it != cells.end();) {
    if (it->second.area <= 0) {
      it = cells.erase(it);
      continue;
    }
    for (double& channel : it->second.linear_rgba) channel /= it->second.area;
    ++it;
  }
  return cells;
}

double srgb_from_linear(double linear) {
  if (linear <= 0.0031308) return 12.92 * linear;
  return 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double linear_from_srgb(double srgb) {
  if (srgb <= 0.04045) return srgb / 12.92;
  return std::pow((srgb + 0.055) / 1.055, 2.4);
}

}  // namespace voxeld::reference
