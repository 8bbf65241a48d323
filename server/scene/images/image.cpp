// decode_image() and what all readers share. The table below is the list of formats; other bytes
// reach no library.
#include "server/scene/images/image.h"

#include <algorithm>
#include <string>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/decoders.h"
#include "server/scene/images/tga.h"

namespace voxeld {
namespace {

constexpr size_t kMessageBytesMax = 200;

struct ImageFormat {
  std::string_view magic;
  size_t magic_at;
  ImageDecoder* decode;
};

constexpr ImageFormat kFormats[] = {
    {"\x89PNG\r\n\x1a\n", 0, decode_png},
    {"\xff\xd8\xff", 0, decode_jpeg},
    {"BM", 0, decode_bmp},
    {"DDS ", 0, decode_dds},
    {"WEBP", 8, decode_webp},
    {"#?", 0, decode_hdr},
    {std::string_view("II*\0", 4), 0, decode_tiff},
    {std::string_view("MM\0*", 4), 0, decode_tiff},
    {"GIF8", 0, decode_gif},
};

}  // namespace

Result<Image> decode_image(std::string_view name, std::span<const uint8_t> bytes,
                           PixelBudget* budget) {
  cancel_point();
  const std::string_view text = as_text(bytes);
  for (const ImageFormat& format : kFormats) {
    if (text.size() > format.magic_at && text.substr(format.magic_at).starts_with(format.magic)) {
      return format.decode(name, bytes, budget);
    }
  }
  if (looks_like_tga(bytes)) return decode_tga(name, bytes, budget);
  return Error{ErrorCode::kUnsupportedMedia, std::string(name) + ": not an image that voxeld reads",
               "PNG, JPEG, TGA, BMP, DDS, WebP, HDR, TIFF or GIF", shown(text.substr(0, 8))};
}

Error malformed_image(std::string_view name, std::string_view what) {
  std::string printable(what.substr(0, kMessageBytesMax));
  for (char& c : printable) {
    if (c == '\n') c = ' ';
    if (c < 0x20 || c > 0x7e) c = '?';  // libraries quote the file
  }
  return {ErrorCode::kMalformedImage, std::string(name) + ": " + printable, "", ""};
}

Error cut_off_image(std::string_view name, uint64_t expected_bytes, uint64_t got_bytes) {
  return {ErrorCode::kMalformedImage, std::string(name) + ": the image is cut off",
          "at least " + std::to_string(expected_bytes) + " bytes",
          std::to_string(got_bytes) + " bytes"};
}

Status check_image_size(std::string_view name, int64_t width, int64_t height) {
  const std::string got = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width <= 0 || height <= 0) {
    return Error{ErrorCode::kMalformedImage, std::string(name) + ": the image is empty",
                 "at least 1 x 1 pixels", got};
  }
  if (width > limits::kImageSideMax || height > limits::kImageSideMax ||
      width * height > limits::kImagePixelsMax) {
    return Error{ErrorCode::kPayloadTooLarge, std::string(name) + ": the image is too large",
                 "at most " + std::to_string(limits::kImagePixelsMax) + " pixels, " +
                     std::to_string(limits::kImageSideMax) + " to a side",
                 got};
  }
  return {};
}

Result<Image> begin_image(std::string_view name, int64_t width, int64_t height, size_t file_bytes,
                          PixelBudget* budget) {
  VOXELD_TRY(check_image_size(name, width, height));
  if (budget != nullptr) VOXELD_TRY(budget->take(name, width, height, file_bytes));
  Image image{.name = std::string(name),
              .width = static_cast<int>(width),
              .height = static_cast<int>(height),
              .rgba = {}};
  resize_in_pieces(image.rgba, 4 * static_cast<size_t>(width) * static_cast<size_t>(height));
  return image;
}

void make_alpha_straight(std::span<uint8_t> rgba) {
  for (size_t i = 0; i + 4 <= rgba.size(); i += 4) {
    cancel_point_at(i);
    const unsigned alpha = rgba[i + 3];
    if (alpha == 0 || alpha == 255) continue;
    for (size_t c = i; c < i + 3; ++c) {
      rgba[c] = static_cast<uint8_t>(std::min(255u, (rgba[c] * 255u + alpha / 2) / alpha));
    }
  }
}

std::string too_many_pixels() {
  return "is left out: the textures of one scene have at most " + std::to_string(kScenePixelsMax) +
         " pixels, and beyond the first " + std::to_string(limits::kImagePixelsMax) + " at most " +
         std::to_string(PixelBudget::kPixelsPerByteMax) + " for each byte of their files";
}

Status PixelBudget::take(std::string_view name, int64_t width, int64_t height, size_t file_bytes) {
  constexpr size_t kBytesMax = kScenePixelsMax / kPixelsPerByteMax;  // a larger file gains nothing
  const int64_t pixels = width * height;
  paid_ += static_cast<int64_t>(std::min(file_bytes, kBytesMax)) * kPixelsPerByteMax;
  is_spent_ = pixels > left_ || pixels > paid_;
  if (is_spent_) {
    return Error{ErrorCode::kPayloadTooLarge, std::string(name) + " " + too_many_pixels(), "", ""};
  }
  left_ -= pixels;
  paid_ -= pixels;
  return {};
}

}  // namespace voxeld
