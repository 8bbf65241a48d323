// Normals of surfaces: transformation, normalization and repair.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace voxeld {

// Transforms a normal by the inverse transpose. The cofactor matrix is that times the determinant,
// and also exists for matrices that flatten. If a matrix mirrors, the normal stays on its side of
// the surface.
inline glm::dvec3 world_normal(const glm::dmat4& world_from_mesh, const glm::dvec3& n) {
  const glm::dmat3 m(world_from_mesh);
  const glm::dmat3 cofactors(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]),
                             glm::cross(m[0], m[1]));
  const glm::dvec3 out = cofactors * n;
  return glm::determinant(m) < 0.0 ? -out : out;
}

// The unit vector along v. (0, 0, 0) if v has no direction; repair_normals() replaces it.
inline glm::vec3 direction_of(const glm::dvec3& v) {
  const double length = glm::length(v);
  if (length > 1e-140 && length < 1e140) return glm::vec3(v / length);
  // Squares of such small or large numbers are inexact, zero or infinite, so v is scaled first.
  const glm::dvec3 sizes = glm::abs(v);
  const double largest = std::max(sizes.x, std::max(sizes.y, sizes.z));
  const bool is_finite = std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  if (!is_finite || largest == 0.0) return glm::vec3(0.0f);
  return glm::vec3(glm::normalize(v / largest));
}

// Replaces normals of (0, 0, 0) by that of an adjacent triangle, or by (0, 0, 1) if it has none.
// `indices`: 3 per triangle, counter-clockwise, each below positions.size(). `normals`: as many as
// positions, or none.
void repair_normals(std::span<const glm::dvec3> positions, std::span<const uint32_t> indices,
                    std::span<glm::vec3> normals);

// Makes the normals of a file unit vectors. Those without a direction are repaired; a vertex that
// no triangle uses gets (0, 0, 1). None are left if none has a direction.
void complete_normals(std::span<const glm::dvec3> positions, std::span<const uint32_t> indices,
                      std::vector<glm::vec3>& normals);

}  // namespace voxeld
