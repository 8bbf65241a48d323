// Textures out of untrusted bytes, by OpenImageIO with a reader chosen from the first bytes and
// caps checked before any pixel is decoded. Without GL builds (VOXELD_WITH_GL off) decode_image
// reports unsupported-feature, so that sanitizer builds need no OpenImageIO.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// PNG, JPEG, TGA, BMP, DDS, WebP, HDR(tonemapped by clamping), TIFF, GIF (first frame). Errors:
// malformed-image with the name, unsupported-media-type for other bytes, payload-too-large over
// kImagePixelsMax.
Result<Image> decode_image(std::string_view name, std::span<const uint8_t> bytes);

}  // namespace voxeld
