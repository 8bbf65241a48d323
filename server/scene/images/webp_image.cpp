// WebP by libwebp.
#include <webp/decode.h>

#include <algorithm>
#include <memory>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

// Between two cancellation points: the bytes that so many pixels take on average, within bounds. A
// lossless header that is not complete yet is decoded again with each piece.
constexpr uint64_t kWebpPixelsAtOnce = uint64_t{1} << 18;
constexpr uint64_t kWebpBytesMin = 1 << 10, kWebpBytesMax = 1 << 16;

const char* text_of(VP8StatusCode status) {
  switch (status) {
    case VP8_STATUS_OK:
      return "no error";
    case VP8_STATUS_OUT_OF_MEMORY:
      return "out of memory";
    case VP8_STATUS_SUSPENDED:
    case VP8_STATUS_NOT_ENOUGH_DATA:
      return "the image is cut off";
    case VP8_STATUS_UNSUPPORTED_FEATURE:
      return "a feature that libwebp does not read";
    default:
      return "not a valid WebP stream";
  }
}

}  // namespace

Result<Image> decode_webp(std::string_view name, std::span<const uint8_t> bytes,
                          PixelBudget* budget) {
  WebPBitstreamFeatures features;
  const VP8StatusCode found = WebPGetFeatures(bytes.data(), bytes.size(), &features);
  if (found != VP8_STATUS_OK) return malformed_image(name, text_of(found));
  if (features.has_animation != 0) {
    return Error{ErrorCode::kUnsupportedFeature, std::string(name) + ": kind of WebP",
                 "a still image", "an animation"};
  }
  VOXELD_ASSIGN(Image image,
                begin_image(name, features.width, features.height, bytes.size(), budget));
  // The decoder writes straight alpha.
  const std::unique_ptr<WebPIDecoder, decltype(&WebPIDelete)> decoder(
      WebPINewRGB(MODE_RGBA, image.rgba.data(), image.rgba.size(), 4 * image.width), WebPIDelete);
  if (decoder == nullptr) return malformed_image(name, text_of(VP8_STATUS_OUT_OF_MEMORY));
  // It reads from `bytes` itself and goes on where it ended. A lossless image of one colour has all
  // its pixels in the last byte, which takes 200 ms for the largest.
  const auto pixels = static_cast<uint64_t>(image.width) * static_cast<uint64_t>(image.height);
  const size_t at_once =
      std::clamp(bytes.size() * kWebpPixelsAtOnce / pixels, kWebpBytesMin, kWebpBytesMax);
  VP8StatusCode status = VP8_STATUS_SUSPENDED;
  for (size_t end = 0; status == VP8_STATUS_SUSPENDED && end < bytes.size();) {
    cancel_point();
    end = std::min(end + at_once, bytes.size());
    status = WebPIUpdate(decoder.get(), bytes.data(), end);
  }
  if (status != VP8_STATUS_OK) return malformed_image(name, text_of(status));
  return image;
}

}  // namespace voxeld
