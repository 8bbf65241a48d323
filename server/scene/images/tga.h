// A reader of Truevision TGA, the texture format of MD5 models. The reader of Debian 12's
// OpenImageIO has memory errors that were never fixed there (CVE-2023-22845, CVE-2023-24473).
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

// Checks an image's size. Every reader must call it before it allocates pixels. Errors:
// payload-too-large over limits::kImagePixelsMax and kImageSideMax, malformed-image for empty
// images.
Status check_image_size(std::string_view name, int64_t width, int64_t height);

}  // namespace voxeld
