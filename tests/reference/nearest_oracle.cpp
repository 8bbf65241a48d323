#include "tests/reference/nearest_oracle.h"

#include <algorithm>

#include "tests/reference/long_vector.h"

namespace voxeld::reference {
namespace {

using Weights = std::array<long double, 3>;

// The search over a triangle whose corners are relative to the centre.
class Search {
 public:
  explicit Search(const std::array<LongVector, 3>& corners) : corners_(corners) {}

  SurfacePoint run() {
    for (size_t i = 0; i < 3; ++i) {
      Weights corner{};
      corner[i] = 1;
      offer(corner);
      try_side(i, (i + 1) % 3);
    }
    try_face();
    return best_;
  }

 private:
  void offer(const Weights& weights) {
    LongVector p{};
    for (size_t i = 0; i < 3; ++i) {
      for (size_t c = 0; c < 3; ++c) p[c] += weights[i] * corners_[i][c];
    }
    const long double squared = dot(p, p);
    if (!is_first_ && squared >= best_.squared) return;
    is_first_ = false;
    best_.squared = squared;
    for (size_t i = 0; i < 3; ++i) best_.barycentric[i] = static_cast<double>(weights[i]);
  }

  void try_side(size_t a, size_t b) {
    const LongVector along = minus(corners_[b], corners_[a]);
    const long double length = dot(along, along);
    if (length == 0) return;
    const long double t = -dot(corners_[a], along) / length;
    if (t <= 0 || t >= 1) return;
    Weights weights{};
    weights[a] = 1 - t;
    weights[b] = t;
    offer(weights);
  }

  // Least squares: the normal equations of v0 + s e1 + t e2.
  void try_face() {
    const LongVector e1 = minus(corners_[1], corners_[0]), e2 = minus(corners_[2], corners_[0]);
    const long double a = dot(e1, e1), b = dot(e1, e2), c = dot(e2, e2);
    const long double det = a * c - b * b;
    if (det <= 0) return;
    const long double f = -dot(e1, corners_[0]), g = -dot(e2, corners_[0]);
    const long double s = (f * c - g * b) / det, t = (g * a - f * b) / det;
    if (s <= 0 || t <= 0 || s + t >= 1) return;
    offer({1 - s - t, s, t});
  }

  const std::array<LongVector, 3>& corners_;
  bool is_first_ = true;
  SurfacePoint best_;
};

}  // namespace

std::map<size_t, std::vector<SurfacePoint>> points_near_centres(
    const std::vector<Triangle>& triangles, const OracleGrid& grid) {
  std::map<size_t, std::vector<SurfacePoint>> cells;
  for (size_t t = 0; t < triangles.size(); ++t) {
    std::array<std::array<int64_t, 3>, 3> snapped{};
    std::array<int, 3> first{}, last{};
    for (size_t c = 0; c < 3; ++c) {
      for (size_t i = 0; i < 3; ++i) {
        const double p_grid = (triangles[t][i][c] - grid.origin[c]) / grid.voxel_size[c];
        snapped[i][c] = snap_512(p_grid, grid.dims[c]);
      }
      const auto [low, high] = std::minmax({snapped[0][c], snapped[1][c], snapped[2][c]});
      first[c] = static_cast<int>(low / 512);
      last[c] = std::min(static_cast<int>(high / 512), grid.dims[c] - 1);
    }
    std::array<int, 3> cell{};
    for (cell[2] = first[2]; cell[2] <= last[2]; ++cell[2]) {
      for (cell[1] = first[1]; cell[1] <= last[1]; ++cell[1]) {
        for (cell[0] = first[0]; cell[0] <= last[0]; ++cell[0]) {
          if (!touches(snapped, cell)) continue;
          std::array<LongVector, 3> corners;
          for (size_t i = 0; i < 3; ++i) {
            for (size_t c = 0; c < 3; ++c) {
              corners[i][c] = static_cast<long double>(snapped[i][c]) / 512 - cell[c] - 0.5L;
            }
          }
          SurfacePoint point = Search(corners).run();
          point.triangle = t;
          const auto row = static_cast<size_t>(cell[1]) +
                           static_cast<size_t>(grid.dims[1]) * static_cast<size_t>(cell[2]);
          cells[static_cast<size_t>(cell[0]) + static_cast<size_t>(grid.dims[0]) * row].push_back(
              point);
        }
      }
    }
  }
  return cells;
}

}  // namespace voxeld::reference
