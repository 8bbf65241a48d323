// Textures out of untrusted bytes, by OpenImageIO with a reader chosen from the first bytes and
// caps checked before any pixel is decoded. Without GL builds (VOXELD_WITH_GL off) decode_image
// reports unsupported-feature, so that sanitizer builds need no OpenImageIO.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

// Pixels of all textures of one scene together; further ones are named in a warning and left out.
// 268 Mpx are 1 GiB as RGBA8.
inline constexpr int64_t kScenePixelsMax = int64_t{1} << 28;

// What the textures of one scene may cost. An image is paid for before it is decoded, whatever
// comes of it: one that is broken at its end costs as much as a good one, and a file of 500 bytes
// can hold the largest.
class PixelBudget {
 public:
  // Beyond the pixels of one image of the largest size, files pay for theirs: less than one bit of
  // a file for each 32 pixels is no picture.
  static constexpr int64_t kPixelsPerByteMax = 256;

  // Errors: payload-too-large.
  Status take(std::string_view name, int64_t width, int64_t height, size_t file_bytes);
  // Something did not get what it asked for: no more of the scene's images need be looked at.
  bool is_spent() const { return is_spent_; }

 private:
  int64_t left_ = kScenePixelsMax;
  int64_t paid_ = limits::kImagePixelsMax;
  bool is_spent_ = false;
};

// What a warning says of an image that the budget does not suffice for.
std::string too_many_pixels();

// PNG, JPEG, TGA, BMP, DDS, WebP, HDR(tonemapped by clamping), TIFF, GIF (first frame). Errors:
// malformed-image with the name, unsupported-media-type for other bytes, payload-too-large over
// kImagePixelsMax, and where the budget (null: none) does not suffice. Has cancel points.
Result<Image> decode_image(std::string_view name, std::span<const uint8_t> bytes,
                           PixelBudget* budget = nullptr);

}  // namespace voxeld
