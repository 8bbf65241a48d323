// A reader of Truevision TGA, the texture format of MD5 models.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/images/image.h"

namespace voxeld {

// Whether the first 18 bytes can be a TGA header. The format has no magic number.
bool looks_like_tga(std::span<const uint8_t> bytes);

// Decodes types 1, 2, 3 and their run-length forms 9, 10, 11, with 8, 15, 16, 24 or 32 bits and any
// origin. Errors: malformed-image with the byte, payload-too-large over limits::kImagePixelsMax.
Result<Image> decode_tga(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget = nullptr);

}  // namespace voxeld
