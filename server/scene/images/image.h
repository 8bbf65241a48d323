// Decodes textures from untrusted bytes. The first bytes choose the reader, and limits are checked
// before any pixel is decoded.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// Pixels of all textures of one scene; 268 Mpx are 1 GiB as RGBA8. Further textures are omitted
// with a warning that names them.
inline constexpr int64_t kScenePixelsMax = int64_t{1} << 28;

// A budget for decoding the textures of one scene. Every image is charged before it is decoded. One
// that is broken at its end costs as much as a good one, and a file of 500 bytes can hold the
// largest.
class PixelBudget {
 public:
  // Pixels per byte of the file. The pixels of one image of the largest size are free; beyond them,
  // a file must have this size. Less than one bit of a file for 32 pixels is no real image.
  static constexpr int64_t kPixelsPerByteMax = 256;

  // Errors: payload-too-large.
  Status take(std::string_view name, int64_t width, int64_t height, size_t file_bytes);
  // Whether some request was refused; the scene's remaining images need not be examined.
  bool is_spent() const { return is_spent_; }

 private:
  int64_t left_ = kScenePixelsMax;
  int64_t paid_ = limits::kImagePixelsMax;
  bool is_spent_ = false;
};

// The text of the warning about an image that exceeds the budget.
std::string too_many_pixels();

// Decodes PNG, JPEG, TGA, BMP, DDS, WebP, HDR (tonemapped by clamping), TIFF and GIF (first frame).
// Errors: malformed-image with the name, unsupported-feature for kinds of these formats that are
// not read (BC7 in a DDS, an animated WebP), unsupported-media-type for other bytes, and
// payload-too-large over kImagePixelsMax or over the budget (null: none). Has cancellation points.
Result<Image> decode_image(std::string_view name, std::span<const uint8_t> bytes,
                           PixelBudget* budget = nullptr);

}  // namespace voxeld
