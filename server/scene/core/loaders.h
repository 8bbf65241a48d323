// The loaders of the formats, one folder of server/scene for each; load.h chooses among them.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/core/bundle.h"
#include "server/scene/core/scene.h"

namespace voxeld {

struct LoadOptions {
  bool decode_images = true;  // off: inspection needs only names
};

// `bundle` resolves the files that the mesh names; `name` appears in
// errors.
Result<Scene> load_obj(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);
Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_stl(std::string_view name, std::span<const uint8_t> bytes);
Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes);
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
