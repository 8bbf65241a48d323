// Loads PLY, the Stanford polygon format: header (header.cpp), body (body.cpp), scene (ply.cpp).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Like load_ply() in load.h, but also finds the texture of "comment TextureFile" in `bundle`.
Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options);

}  // namespace voxeld
