#include "server/render/silhouette.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

namespace voxeld {
namespace {

constexpr double kMarginPixels = 2.0;
constexpr double kWMin = 1e-9;  // of the largest w

// Twice the area of the triangle, positive if it turns left.
double turn(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979).
std::vector<glm::dvec2> convex_hull(std::vector<glm::dvec2> points) {
  std::ranges::sort(points, [](const glm::dvec2& a, const glm::dvec2& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  });
  std::vector<glm::dvec2> hull;
  const auto half = [&](auto begin, auto end) {
    const size_t base = hull.size();
    for (auto at = begin; at != end; ++at) {
      while (hull.size() >= base + 2 && turn(hull.end()[-2], hull.back(), *at) <= 0) {
        hull.pop_back();
      }
      hull.push_back(*at);
    }
    hull.pop_back();  // the first one of the other half
  };
  half(points.begin(), points.end());
  half(points.rbegin(), points.rend());
  return hull;
}

}  // namespace

Silhouette::Silhouette(const Camera& camera, const Subject& subject, int width, int height)
    : rows_(static_cast<size_t>(height), Columns{0, width}) {
  std::vector<glm::dvec4> clip;
  double w_max = 0;
  for (const glm::dvec3& point : subject.points_world) {
    clip.push_back(camera.clip_from_world * glm::dvec4(point, 1.0));
    w_max = std::max(w_max, std::abs(clip.back().w));
  }
  std::vector<glm::dvec2> points;
  for (const glm::dvec4& at : clip) {
    if (!(at.w > kWMin * w_max)) return;
    const glm::dvec2 pixel = (glm::dvec2(at) / at.w + 1.0) * 0.5 * glm::dvec2(width, height);
    if (!std::isfinite(pixel.x) || !std::isfinite(pixel.y)) return;
    points.push_back(pixel);
  }
  if (points.size() < 3) return;
  const std::vector<glm::dvec2> hull = convex_hull(std::move(points));
  if (hull.size() < 3) return;

  struct Extent {
    double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
  };
  std::vector<Extent> extents(rows_.size());
  for (size_t i = 0; i < hull.size(); ++i) {
    const glm::dvec2 a = hull[i], b = hull[(i + 1) % hull.size()];
    const double bottom = std::min(a.y, b.y), top = std::max(a.y, b.y);
    const double first = std::max(std::floor(bottom - kMarginPixels) - 1.0, 0.0);
    const double last = std::min(std::ceil(top + kMarginPixels), height - 1.0);
    if (first > last) continue;  // below or above the image
    for (auto row = static_cast<size_t>(first); row <= static_cast<size_t>(last); ++row) {
      // The part of the edge within the row, with its margin.
      Extent& extent = extents[row];
      const auto y = static_cast<double>(row);
      for (const double limit : {y - kMarginPixels, y + 1.0 + kMarginPixels}) {
        const double at = std::clamp(limit, bottom, top);
        const double part = b.y == a.y ? 0.0 : (at - a.y) / (b.y - a.y);
        const double x = a.x + (b.x - a.x) * part;
        extent.low = std::min(extent.low, b.y == a.y ? std::min(a.x, b.x) : x);
        extent.high = std::max(extent.high, b.y == a.y ? std::max(a.x, b.x) : x);
      }
    }
  }
  for (size_t y = 0; y < rows_.size(); ++y) {
    const double low = std::floor(extents[y].low - kMarginPixels);
    const double high = std::ceil(extents[y].high + kMarginPixels);
    rows_[y] = {static_cast<int>(std::clamp(low, 0.0, static_cast<double>(width))),
                static_cast<int>(std::clamp(high, 0.0, static_cast<double>(width)))};
    if (rows_[y].end < rows_[y].first) rows_[y] = {0, 0};
  }
}

}  // namespace voxeld
