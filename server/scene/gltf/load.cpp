// load_gltf and load_animated_gltf: reads one glTF file. doubleSided, metalness and roughness,
// cameras and lights are ignored: a grid has no use for them.
#include <optional>
#include <utility>

#include "server/scene/core/animated_scene.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/container.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/mesh.h"
#include "server/scene/gltf/rig.h"
#include "server/scene/gltf/textures.h"
#include "server/scene/gltf/variants.h"

namespace voxeld {
namespace {

// Loads the scene into `to`, and the rig if it is asked for.
Status load(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
            const LoadOptions& options, bool with_rig, AnimatedScene& to) {
  VOXELD_ASSIGN(const gltf::Container container, gltf::open_container(name, bytes));
  Scene& scene = to.scene;
  scene.format = container.is_glb ? "glb" : "gltf";
  VOXELD_ASSIGN(gltf::Document document,
                gltf::read_document(name, container.json, with_rig, scene));
  if (options.variant) VOXELD_TRY(gltf::choose_variant(document, *options.variant));
  if (!with_rig && document.has_animations) {
    add_warning(scene, "static-pose",
                document.name + ": animations are left out; the mesh has the file's own pose");
  }
  gltf::Accessors accessors(document, container, bundle, scene);
  gltf::Textures textures(document, accessors, bundle, options, scene);
  gltf::RigBuilder rig(document, accessors, with_rig);
  VOXELD_TRY(add_meshes(document, accessors, textures, scene, rig));
  return with_rig ? rig.finish(to) : Status();
}

}  // namespace

Result<Scene> load_gltf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                        const LoadOptions& options) {
  AnimatedScene loaded;
  VOXELD_TRY(load(name, bytes, bundle, options, false, loaded));
  return std::move(loaded.scene);
}

Result<AnimatedScene> load_animated_gltf(std::string_view name, std::span<const uint8_t> bytes,
                                         const Bundle& bundle, const LoadOptions& options) {
  AnimatedScene loaded;
  VOXELD_TRY(load(name, bytes, bundle, options, true, loaded));
  return loaded;
}

}  // namespace voxeld
