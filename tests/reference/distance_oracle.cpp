#include "tests/reference/distance_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/reference/long_vector.h"

namespace voxeld::reference {
namespace {

// To the foot of the perpendicular on the side, if that lies within the side.
std::optional<long double> to_side(const LongVector& p, const LongVector& a, const LongVector& b) {
  const LongVector ab = minus(b, a), ap = minus(p, a);
  const long double length = dot(ab, ab);
  if (length == 0) return std::nullopt;
  const long double t = dot(ap, ab) / length;
  if (t < 0 || t > 1) return std::nullopt;
  return std::max(0.0L, dot(ap, ap) - t * t * length);
}

// To the foot on the plane a + s ab + t ac, if that lies within the triangle: s and t solve the
// normal equations.
std::optional<long double> to_face(const LongVector& p, const LongVector& a, const LongVector& b,
                                   const LongVector& c) {
  const LongVector ab = minus(b, a), ac = minus(c, a), ap = minus(p, a);
  const long double bb = dot(ab, ab), bc = dot(ab, ac), cc = dot(ac, ac);
  const long double determinant = bb * cc - bc * bc;
  if (determinant == 0) return std::nullopt;
  const long double pb = dot(ap, ab), pc = dot(ap, ac);
  const long double s = (cc * pb - bc * pc) / determinant;
  const long double t = (bb * pc - bc * pb) / determinant;
  if (s < 0 || t < 0 || s + t > 1) return std::nullopt;
  LongVector away{};
  for (size_t i = 0; i < 3; ++i) away[i] = ap[i] - s * ab[i] - t * ac[i];
  return dot(away, away);
}

}  // namespace

long double surface_distance(const SnappedTriangles& triangles, const std::array<int, 3>& cell,
                             const std::array<double, 3>& edges) {
  const auto place = [&](size_t axis, int64_t at) {
    return static_cast<long double>(edges[axis]) * static_cast<long double>(at);
  };
  LongVector p{};
  for (size_t i = 0; i < 3; ++i) p[i] = place(i, cell[i] * 512 + 256);
  long double least = std::numeric_limits<long double>::infinity();
  const auto consider = [&](std::optional<long double> squared) {
    if (squared) least = std::min(least, *squared);
  };
  for (const auto& triangle : triangles) {
    std::array<LongVector, 3> v;
    for (size_t i = 0; i < 3; ++i) {
      for (size_t c = 0; c < 3; ++c) v[i][c] = place(c, triangle[i][c]);
    }
    for (size_t i = 0; i < 3; ++i) {
      const LongVector away = minus(v[i], p);
      consider(dot(away, away));
      consider(to_side(p, v[i], v[(i + 1) % 3]));
    }
    consider(to_face(p, v[0], v[1], v[2]));
  }
  return std::sqrt(least);
}

std::optional<std::array<int, 3>> nearest_cell(const Occupancy& set, const OracleGrid& grid,
                                               const std::array<int, 3>& cell) {
  std::optional<std::array<int, 3>> nearest;
  long least = 0;
  size_t at = 0;
  for (int z = 0; z < grid.dims[2]; ++z) {
    for (int y = 0; y < grid.dims[1]; ++y) {
      for (int x = 0; x < grid.dims[0]; ++x) {
        if (set[at++] == 0) continue;
        const long dx = x - cell[0], dy = y - cell[1], dz = z - cell[2];
        const long squared = dx * dx + dy * dy + dz * dz;
        if (nearest && squared >= least) continue;
        least = squared;
        nearest = {x, y, z};
      }
    }
  }
  return nearest;
}

}  // namespace voxeld::reference
