#include <algorithm>

#include <glm/vec3.hpp>

#include "tests/bench/rival.h"

namespace voxeld::bench {

GridMesh grid_mesh(const Scene& scene, int size) {
  const Box3d box = scene.bounds();
  const glm::dvec3 extent = box.max - box.min;
  const double scale = size / std::max({extent.x, extent.y, extent.z});
  GridMesh mesh;
  mesh.size = size;
  for (const MeshPart& part : scene.parts) {
    const auto first = static_cast<int>(mesh.positions.size() / 3);
    for (const glm::dvec3& p : part.positions) {
      const glm::dvec3 q = (p - box.min) * scale;
      for (int c = 0; c < 3; ++c) mesh.positions.push_back(static_cast<float>(q[c]));
    }
    for (const uint32_t i : part.indices) mesh.indices.push_back(first + static_cast<int>(i));
  }
  return mesh;
}

}  // namespace voxeld::bench
