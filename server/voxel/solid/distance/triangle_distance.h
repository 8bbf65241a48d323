// The distance from a point to a triangle, also in a space that is stretched along its axes.
#pragma once

#include <algorithm>
#include <array>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace voxeld {

// Squared distance from the origin to the segment a + t (b - a), 0 <= t <= 1.
inline double squared_distance_to_segment(const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 along = b - a;
  const double length = glm::dot(along, along);
  const double t = length > 0 ? std::clamp(-glm::dot(a, along) / length, 0.0, 1.0) : 0.0;
  const glm::dvec3 nearest = a + along * t;
  return glm::dot(nearest, nearest);
}

// Squared distance from the origin to the closed triangle, which may be a segment or a point. It is
// the distance to the plane if the origin's projection lies in the triangle, else to the nearest
// side. Eberly 1999, "Distance between point and triangle in 3D", sorts the same cases by regions.
// The last bits depend on the order of the corners, so callers must give them in a fixed order.
// scale: the factors by which space is stretched after the corners were measured. Corners stay
// integers that way, and what is exact about them stays exact.
inline double squared_distance_to_triangle(const std::array<glm::dvec3, 3>& v,
                                           const glm::dvec3& scale = glm::dvec3(1.0)) {
  // Twice the areas of the triangles between the origin and each side. Their sum is the triangle's.
  // Exact for integer corners within 2^26 of the origin.
  const std::array<glm::dvec3, 3> sides = {glm::cross(v[0], v[1]), glm::cross(v[1], v[2]),
                                           glm::cross(v[2], v[0])};
  const glm::dvec3 normal = sides[0] + sides[1] + sides[2];
  // Stretching multiplies cross products by its cofactors, and their dot products by the squares.
  const glm::dvec3 cofactors(scale.y * scale.z, scale.z * scale.x, scale.x * scale.y);
  const glm::dvec3 stretched = normal * (cofactors * cofactors);
  const double area = glm::dot(stretched, normal);
  const std::array<bool, 3> outside = {glm::dot(stretched, sides[0]) < 0,
                                       glm::dot(stretched, sides[1]) < 0,
                                       glm::dot(stretched, sides[2]) < 0};
  // Corners farther away are rounded. An area that rounding alone could have made counts as none.
  const double rounded = 1e-28 * (glm::dot(sides[0], sides[0]) + glm::dot(sides[1], sides[1]) +
                                  glm::dot(sides[2], sides[2]));
  const bool flat = !(glm::dot(normal, normal) > rounded);
  if (!flat && !outside[0] && !outside[1] && !outside[2]) {
    const double height = glm::dot(normal, v[0]) * (scale.x * scale.y * scale.z);
    return height * height / area;
  }
  // The nearest point lies on a side whose outer half-plane holds the origin.
  double least = 1e300;
  for (size_t i = 0; i < 3; ++i) {
    if (!flat && !outside[i]) continue;
    least =
        std::min(least, squared_distance_to_segment(v[i] * scale, v[i == 2 ? 0 : i + 1] * scale));
  }
  return least;
}

}  // namespace voxeld
