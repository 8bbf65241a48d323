#include "server/scene/describe_asset.h"

#include <algorithm>

namespace voxeld {
namespace {

AssetDescription::Mesh describe_mesh(const AnimatedScene& animated, size_t index) {
  const MeshPart& part = animated.scene.parts[index];
  AssetDescription::Mesh mesh{.name = part.name, .material = part.material};
  mesh.triangle_count = static_cast<int64_t>(part.indices.size() / 3);
  if (!animated.rig) return mesh;
  const SkinTable& skin = animated.skin;
  const size_t end = skin.part_first_vertex[index + 1];
  for (size_t v = skin.part_first_vertex[index]; v < end; ++v) {
    mesh.influences_max = std::max(mesh.influences_max,
                                   int64_t{skin.first_influence[v + 1]} - skin.first_influence[v]);
    if (!skin.first_morph.empty() && skin.first_morph[v + 1] > skin.first_morph[v]) {
      mesh.has_morph_targets = true;
    }
  }
  return mesh;
}

}  // namespace

AssetDescription describe_asset(const AnimatedScene& animated) {
  const Scene& scene = animated.scene;
  AssetDescription out;
  out.format = scene.format;
  out.bounds = scene.bounds();
  for (size_t p = 0; p < scene.parts.size(); ++p) out.meshes.push_back(describe_mesh(animated, p));
  for (const Material& material : scene.materials) {
    out.materials.push_back(
        {material.name,
         material.image < 0 ? "" : scene.images[static_cast<size_t>(material.image)].name});
  }
  out.missing_files = scene.missing_files;
  out.joints = animated.joints;
  out.animations = animated.animations;
  out.warnings = scene.warnings;
  return out;
}

}  // namespace voxeld
