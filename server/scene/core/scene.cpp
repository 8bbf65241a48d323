#include "server/scene/core/scene.h"

#include "server/base/cancel_point.h"

namespace voxeld {

size_t Scene::triangle_count() const {
  size_t count = 0;
  for (const MeshPart& part : parts) count += part.indices.size() / 3;
  return count;
}

size_t Scene::vertex_count() const {
  size_t count = 0;
  for (const MeshPart& part : parts) count += part.positions.size();
  return count;
}

Box3d Scene::bounds() const {
  Box3d box;
  for (const MeshPart& part : parts) {
    for (const uint32_t index : part.indices) {
      cancel_point();
      box.add(part.positions[index]);
    }
  }
  return box;
}

bool Scene::has_colors() const {
  if (colors_given) return true;
  for (const MeshPart& part : parts) {
    if (!part.colors.empty()) return true;
    if (part.material < 0 || part.uvs.empty()) continue;
    if (materials[static_cast<size_t>(part.material)].image >= 0) return true;
  }
  return false;
}

}  // namespace voxeld
