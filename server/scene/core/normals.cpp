#include "server/scene/core/normals.h"

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {

void repair_normals(std::span<const glm::dvec3> positions, std::span<const uint32_t> indices,
                    std::span<glm::vec3> normals) {
  for (size_t i = 0; i + 2 < indices.size() && !normals.empty(); i += 3) {
    cancel_point();
    const uint32_t* corner = &indices[i];
    for (int c = 0; c < 3; ++c) {
      if (normals[corner[c]] != glm::vec3(0.0f)) continue;
      const glm::dvec3& a = positions[corner[0]];
      const glm::dvec3 n = glm::cross(positions[corner[1]] - a, positions[corner[2]] - a);
      const glm::vec3 normal = direction_of(n);
      normals[corner[c]] = normal != glm::vec3(0.0f) ? normal : glm::vec3(0.0f, 0.0f, 1.0f);
    }
  }
}

void complete_normals(std::span<const glm::dvec3> positions, std::span<const uint32_t> indices,
                      std::vector<glm::vec3>& normals) {
  size_t lost_count = 0;
  for (glm::vec3& n : normals) {
    cancel_point();
    const float square = glm::dot(n, n);
    n = square > 1e-30f && square < 1e30f ? glm::normalize(n) : direction_of(n);
    if (n == glm::vec3(0.0f)) ++lost_count;
  }
  if (lost_count == 0) return;
  if (lost_count == normals.size()) return free_in_pieces(normals);
  repair_normals(positions, indices, normals);
  for (glm::vec3& n : normals) {
    cancel_point();
    if (n == glm::vec3(0.0f)) n = glm::vec3(0.0f, 0.0f, 1.0f);
  }
}

}  // namespace voxeld
