// The readers of decode_image(), one for each format, and what they share.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/images/image.h"

namespace voxeld {

// Decodes one format. Errors: as decode_image().
//
// The libraries are C. No exception passes through their frames: their callbacks read memory or
// store a message, and cancel_point() is called between calls. Where a library reports errors by
// longjmp(), a setjmp() stands around every single call, so a jump skips only frames that have
// nothing to destroy.
using ImageDecoder = Result<Image>(std::string_view name, std::span<const uint8_t> bytes,
                                   PixelBudget* budget);

ImageDecoder decode_bmp;
ImageDecoder decode_dds;
ImageDecoder decode_gif;
ImageDecoder decode_hdr;
ImageDecoder decode_jpeg;
ImageDecoder decode_png;
ImageDecoder decode_tiff;
ImageDecoder decode_webp;

// malformed-image with a library's words, made printable and cut after 200 bytes.
Error malformed_image(std::string_view name, std::string_view what);

// malformed-image for a file that ends within its pixels.
Error cut_off_image(std::string_view name, uint64_t expected_bytes, uint64_t got_bytes);

// Checks an image's size. Errors: payload-too-large over limits::kImagePixelsMax and kImageSideMax,
// malformed-image for empty images.
Status check_image_size(std::string_view name, int64_t width, int64_t height);

// Checks the size, charges the budget (null: none) and allocates the pixels, all 0. Every reader
// calls it before it decodes a pixel. Errors: those of check_image_size() and PixelBudget::take().
Result<Image> begin_image(std::string_view name, int64_t width, int64_t height, size_t file_bytes,
                          PixelBudget* budget);

// The number that the bytes (at most 8) are in little-endian order.
inline uint64_t little_endian(std::span<const uint8_t> bytes) {
  uint64_t value = 0;
  for (size_t i = 0; i < bytes.size(); ++i) value |= uint64_t{bytes[i]} << (8 * i);
  return value;
}

inline uint8_t* image_row(Image& image, int y) {
  return image.rgba.data() + 4 * static_cast<size_t>(y) * static_cast<size_t>(image.width);
}

// Divides the colours of RGBA pixels by their alpha.
void make_alpha_straight(std::span<uint8_t> rgba);

}  // namespace voxeld
