#include "server/voxel/triangles/clip.h"

#include <algorithm>
#include <span>
#include <tuple>
#include <utility>

namespace voxeld {
namespace {

bool comes_first(const glm::dvec3& a, const glm::dvec3& b) {
  return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

// The point where the edge crosses p[axis] = plane. One end lies on each side. The ends are sorted
// first, so that neighbours compute the same bits.
ClipCorner crossing(ClipCorner a, ClipCorner b, int axis, double plane) {
  if (comes_first(b.p_grid, a.p_grid)) std::swap(a, b);
  const double t = (plane - a.p_grid[axis]) / (b.p_grid[axis] - a.p_grid[axis]);
  ClipCorner c;
  c.p_grid = a.p_grid + t * (b.p_grid - a.p_grid);
  c.p_grid[axis] = plane;
  for (size_t i = 0; i < 3; ++i) c.weights[i] = a.weights[i] + t * (b.weights[i] - a.weights[i]);
  return c;
}

// Keeps the part with sign * p[axis] <= sign * plane.
ClipPolygon clip_plane(const ClipPolygon& polygon, int axis, double plane, double sign) {
  ClipPolygon out;
  for (size_t i = 0; i < polygon.count; ++i) {
    const ClipCorner& a = polygon.corners[i];
    const ClipCorner& b = polygon.corners[(i + 1) % polygon.count];
    const double side_a = sign * (a.p_grid[axis] - plane);
    const double side_b = sign * (b.p_grid[axis] - plane);
    if (side_a <= 0 && out.count < ClipPolygon::kCornersMax) out.corners[out.count++] = a;
    if (((side_a < 0 && side_b > 0) || (side_a > 0 && side_b < 0)) &&
        out.count < ClipPolygon::kCornersMax) {
      out.corners[out.count++] = crossing(a, b, axis, plane);
    }
  }
  return out;
}

}  // namespace

ClipPolygon clip_triangle(const std::array<glm::dvec3, 3>& p_grid, const glm::dvec3& box_min,
                          const glm::dvec3& box_max) {
  ClipPolygon polygon;
  polygon.count = 3;
  for (size_t i = 0; i < 3; ++i) {
    polygon.corners[i].p_grid = p_grid[i];
    polygon.corners[i].weights[i] = 1.0;
  }
  for (int axis = 0; axis < 3; ++axis) {
    polygon = clip_plane(polygon, axis, box_min[axis], -1.0);
    polygon = clip_plane(polygon, axis, box_max[axis], 1.0);
  }
  if (polygon.count < 3) polygon.count = 0;
  const std::span<ClipCorner> corners(polygon.corners.data(), polygon.count);
  const auto first = std::ranges::min_element(
      corners,
      [](const ClipCorner& a, const ClipCorner& b) { return comes_first(a.p_grid, b.p_grid); });
  std::rotate(corners.begin(), first, corners.end());
  return polygon;
}

}  // namespace voxeld
