// Clipping of triangles that leave the grid's box, before they are snapped.
#pragma once

#include <array>
#include <cstddef>

#include <glm/vec3.hpp>

namespace voxeld {

struct ClipCorner {
  glm::dvec3 p_grid{0.0};
  std::array<double, 3> weights{};  // weights of the original triangle's vertices; sum 1
};

// A convex polygon; empty if count < 3.
struct ClipPolygon {
  static constexpr size_t kCornersMax = 9;  // 3, and one more for each of 6 planes
  std::array<ClipCorner, kCornersMax> corners{};
  size_t count = 0;
};

// The part of the triangle inside the closed box, in the triangle's orientation (Sutherland &
// Hodgman 1974, "Reentrant polygon clipping"). Unlike there, the new point of an edge is computed
// from its end points in one fixed order. Neighbours that share the edge therefore get the same
// point, bit for bit. The first corner is the least one (by x, then y, then z), so that a fan from
// it does not depend on the order of the triangle's corners.
ClipPolygon clip_triangle(const std::array<glm::dvec3, 3>& p_grid, const glm::dvec3& box_min,
                          const glm::dvec3& box_max);

}  // namespace voxeld
