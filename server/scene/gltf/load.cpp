// load_gltf and load_animated_gltf: reads one glTF file. doubleSided, alphaMode, metalness and
// roughness, cameras and lights are ignored: a grid has no use for them. Skins and morph targets
// stand in the pose in which the file leaves them.
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "server/scene/animated_scene.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/buffers.h"
#include "server/scene/gltf/container.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/extensions.h"
#include "server/scene/gltf/json.h"
#include "server/scene/gltf/nodes.h"
#include "server/scene/gltf/primitive.h"
#include "server/scene/gltf/rig.h"
#include "server/scene/gltf/textures.h"
#include "server/scene/load.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

void warn_about_unread(std::string_view name, const nlohmann::json& json, bool is_animated,
                       Scene& scene) {
  warn_about_extensions(name, json, scene);
  const auto animations = json.find("animations");
  if (!is_animated && animations != json.end() && !animations->empty()) {
    add_warning(scene, "static-pose",
                std::string(name) + ": animations are left out; the mesh has the file's own pose");
  }
}

// Moves the animations out of the document, before it is reduced to its static parts.
Result<nlohmann::json> take_animations(std::string_view name, nlohmann::json& json) {
  VOXELD_TRY(check_gltf_animation_schema(name, json));
  const auto animations = json.find("animations");
  if (animations == json.end()) return nlohmann::json(nlohmann::json::array());
  return std::move(*animations);
}

// Loads the scene, and the rig if `animated` is not null.
Result<Scene> load(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                   const LoadOptions& options, AnimatedScene* animated) {
  VOXELD_ASSIGN(const GltfContainer container, open_gltf_container(name, bytes));
  VOXELD_ASSIGN(nlohmann::json json, parse_gltf_json(name, container.json));
  VOXELD_TRY(check_gltf_version(name, json));
  VOXELD_TRY(check_gltf_schema(name, json));
  Scene scene;
  scene.format = container.is_glb ? "glb" : "gltf";
  warn_about_unread(name, json, animated != nullptr, scene);
  nlohmann::json animations;
  if (animated != nullptr) {
    VOXELD_ASSIGN(animations, take_animations(name, json));
  }
  GltfBuffers buffers(name, container, bundle, json);
  std::vector<GltfImage> images = take_gltf_images(json);
  VOXELD_ASSIGN(const GltfDocument document, read_gltf_document(name, json));
  json.clear();  // a tree of millions of values, not needed any more
  VOXELD_ASSIGN(const GltfNodes nodes, walk_gltf_nodes(name, document));

  GltfAccessors accessors(name, document, buffers);
  GltfTextures textures(name, document, std::move(images), accessors, bundle, options, scene);
  GltfRigBuilder rig(name, document, nodes);
  GltfMeshes meshes(name, document, nodes, accessors, textures, scene,
                    animated == nullptr ? nullptr : &rig);
  for (const int node : nodes.shown) VOXELD_TRY(meshes.add_node(node));
  if (meshes.skipped_primitive_count() > 0) {
    add_warning(scene, "skipped-primitive",
                std::string(name) + ": " + std::to_string(meshes.skipped_primitive_count()) +
                    " primitives of points or lines were left out");
  }
  if (scene.triangle_count() == 0) {
    const int64_t skipped = meshes.skipped_primitive_count();
    return empty_mesh(name, skipped > 0 ? std::to_string(skipped) + " primitives of points or lines"
                                        : "no node with a mesh in the scene");
  }
  if (animated != nullptr) {
    animated->scene = std::move(scene);
    VOXELD_TRY(rig.finish(accessors, animations, *animated));
    return Scene();
  }
  return scene;
}

// Catches nlohmann's exceptions, which remain possible if check_gltf_schema has a hole. Their texts
// are about JSON types and not about the file, so they are not shown.
template <typename Load>
auto guarded(std::string_view name, const Load& load_file) -> decltype(load_file()) {
  try {
    return load_file();
  } catch (const nlohmann::json::exception&) {
    return malformed_mesh(name, "", "wrong value", "the types of the glTF 2.0 schema", "others");
  }
}

}  // namespace

Result<Scene> load_gltf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                        const LoadOptions& options) {
  return guarded(name, [&] { return load(name, bytes, bundle, options, nullptr); });
}

Result<AnimatedScene> load_animated_gltf(std::string_view name, std::span<const uint8_t> bytes,
                                         const Bundle& bundle, const LoadOptions& options) {
  return guarded(name, [&]() -> Result<AnimatedScene> {
    AnimatedScene animated;
    VOXELD_TRY(load(name, bytes, bundle, options, &animated));
    return animated;
  });
}

}  // namespace voxeld
