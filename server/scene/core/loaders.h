// The loaders of the formats, one folder of server/scene for each; load.h chooses among them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/core/bundle.h"
#include "server/scene/core/scene.h"

namespace voxeld {

struct LoadOptions {
  bool decode_images = true;  // off: inspection needs only names
  // Name or number of a variant of a glTF file's materials; unset: the materials of its primitives.
  std::optional<std::string> variant = {};
};

// `bundle` resolves the files that the mesh names; `name` appears in
// errors.
Result<Scene> load_obj(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_stl(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes);
// The model part that a bundle begins with if it is a 3MF package; nullopt if it is none. Errors:
// malformed-mesh for relationships that are not XML.
Result<std::optional<std::string>> find_3mf_model(const Bundle& bundle);
// Loads the build of a package from the model part that it begins with.
Result<Scene> load_3mf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
// Loads an md5mesh in its bind pose.
Result<Scene> load_md5(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
// Loads glTF 2.0, as JSON or GLB.
Result<Scene> load_gltf(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                        const LoadOptions& options);

// The same with the rig and the animations.
Result<AnimatedScene> load_animated_md5(std::string_view name, std::span<const uint8_t> bytes,
                                        const Bundle& bundle, const LoadOptions& options);
Result<AnimatedScene> load_animated_gltf(std::string_view name, std::span<const uint8_t> bytes,
                                         const Bundle& bundle, const LoadOptions& options);

}  // namespace voxeld
