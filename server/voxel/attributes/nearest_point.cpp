#include "server/voxel/attributes/nearest_point.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <glm/geometric.hpp>

namespace voxeld {
namespace {

constexpr double kOne = 1 << 24;

int weight24(double share) {
  return static_cast<int>(std::floor(std::clamp(share, 0.0, 1.0) * kOne + 0.5));
}

// The nearest of the points a + t (b - a), 0 <= t <= 1. a and b are the corners `from` and `to`.
NearestPoint nearest_on_side(const std::array<glm::dvec3, 3>& corners, int from, int to) {
  const glm::dvec3& a = corners[static_cast<size_t>(from)];
  const glm::dvec3 along = corners[static_cast<size_t>(to)] - a;
  const double length = glm::dot(along, along);
  const double t = length > 0 ? std::clamp(-glm::dot(a, along) / length, 0.0, 1.0) : 0.0;
  const glm::dvec3 nearest = a + along * t;
  NearestPoint point{glm::dot(nearest, nearest), glm::ivec3(0)};
  point.weights[to] = weight24(t);
  point.weights[from] = (1 << 24) - point.weights[to];
  return point;
}

}  // namespace

NearestPoint nearest_point(const std::array<glm::dvec3, 3>& corners) {
  // Twice the areas of the triangles between the origin and each side, exact. Their sum is the
  // triangle's.
  const std::array<glm::dvec3, 3> sides = {glm::cross(corners[1], corners[2]),
                                           glm::cross(corners[2], corners[0]),
                                           glm::cross(corners[0], corners[1])};
  const glm::dvec3 normal = sides[0] + sides[1] + sides[2];
  const double area = glm::dot(normal, normal);
  const std::array<double, 3> beyond = {glm::dot(normal, sides[0]), glm::dot(normal, sides[1]),
                                        glm::dot(normal, sides[2])};
  if (area > 0 && beyond[0] >= 0 && beyond[1] >= 0 && beyond[2] >= 0) {
    const double height = glm::dot(normal, corners[0]);
    NearestPoint point{height * height / area, glm::ivec3(0)};
    point.weights.y = weight24(beyond[1] / area);
    point.weights.z = std::min(weight24(beyond[2] / area), (1 << 24) - point.weights.y);
    point.weights.x = (1 << 24) - point.weights.y - point.weights.z;
    return point;
  }
  // The nearest point lies on a side whose outer half-plane holds the origin.
  constexpr std::array<std::array<int, 3>, 3> kSides = {{{0, 1, 2}, {0, 2, 1}, {1, 2, 0}}};
  NearestPoint least;
  least.squared = 1e300;
  for (const auto& [from, to, opposite] : kSides) {
    if (area > 0 && beyond[static_cast<size_t>(opposite)] >= 0) continue;
    const NearestPoint point = nearest_on_side(corners, from, to);
    if (point.squared < least.squared) least = point;
  }
  return least;
}

}  // namespace voxeld
