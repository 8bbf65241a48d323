// WebP by libwebp.
#include <webp/decode.h>

#include <algorithm>
#include <memory>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

constexpr size_t kBytesAtOnce = size_t{1} << 16;  // between two cancellation points

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
  // It reads from `bytes` itself and goes on where it ended. A lossless image may have all its
  // pixels in one piece, which takes a second for the largest.
  VP8StatusCode status = VP8_STATUS_SUSPENDED;
  for (size_t end = 0; status == VP8_STATUS_SUSPENDED && end < bytes.size();) {
    cancel_point();
    end = std::min(end + kBytesAtOnce, bytes.size());
    status = WebPIUpdate(decoder.get(), bytes.data(), end);
  }
  if (status != VP8_STATUS_OK) return malformed_image(name, text_of(status));
  return image;
}

}  // namespace voxeld
