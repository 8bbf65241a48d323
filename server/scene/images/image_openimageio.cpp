// The part of decode_image() that needs OpenImageIO, for the module (base/image_module.h).
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/process/image_module.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/images/image_format.h"
#include "server/scene/images/tga.h"

namespace voxeld {
namespace {

Error malformed(std::string_view name, std::string what) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  for (char& c : what) {
    if (c < 0x20 || c > 0x7e) c = '?';  // the libraries quote the file
  }
  return {ErrorCode::kMalformedImage, std::string(name) + ": " + what.substr(0, 200), "", ""};
}

uint8_t srgb_byte(float linear) {
  if (!(linear > 0.0f)) return 0;
  const float c = std::min(linear, 1.0f);
  const float encoded = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
  return static_cast<uint8_t>(std::lround(255.0f * encoded));
}

// Expands one row of 1 to 4 channels: grey, grey and alpha, RGB, RGBA.
void expand_row(const uint8_t* from, int channel_count, int width, uint8_t* to) {
  for (int x = 0; x < width; ++x, from += channel_count, to += 4) {
    const bool is_grey = channel_count < 3;
    to[0] = from[0];
    to[1] = from[is_grey ? 0 : 1];
    to[2] = from[is_grey ? 0 : 2];
    to[3] = channel_count % 2 == 0 ? from[channel_count - 1] : uint8_t{255};
  }
}

// Reads a Radiance image. It is linear and unbounded, so it is clamped to 1 and then encoded as
// sRGB.
bool read_linear(OIIO::ImageInput& input, int channel_count, Image& image) {
  std::vector<float> row(static_cast<size_t>(image.width) * channel_count);
  std::vector<uint8_t> bytes(row.size());
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    if (!input.read_scanline(y + input.spec().y, 0, OIIO::TypeFloat, row.data())) return false;
    std::transform(row.begin(), row.end(), bytes.begin(), srgb_byte);
    expand_row(bytes.data(), channel_count, image.width,
               &image.rgba[4 * static_cast<size_t>(y) * image.width]);
  }
  return true;
}

// Reads all rows, in chunks if the format has rows, so a cancellation does not wait for 67
// megapixels. Readers of tiles, and of WebP and GIF, decode the whole image with its first row and
// take up to a second.
bool read_packed(OIIO::ImageInput& input, int channel_count, const Image& image, uint8_t* packed) {
  constexpr int kPixelsAtOnce = 1 << 20;
  const OIIO::ImageSpec& spec = input.spec();
  if (spec.tile_width > 0) {
    return input.read_image(0, 0, 0, channel_count, OIIO::TypeUInt8, packed);
  }
  const int rows = std::max(1, kPixelsAtOnce / image.width);
  const size_t row_bytes = static_cast<size_t>(image.width) * channel_count;
  for (int y = 0; y < image.height; y += rows) {
    cancel_point();
    const int end = std::min(y + rows, image.height);
    if (!input.read_scanlines(0, 0, spec.y + y, spec.y + end, 0, 0, channel_count, OIIO::TypeUInt8,
                              packed + row_bytes * y)) {
      return false;
    }
  }
  return true;
}

// Decodes in place. Rows of fewer channels are stored at the end of the pixels and expanded from
// the front; the expansion never overtakes them.
bool read_bytes(OIIO::ImageInput& input, int channel_count, Image& image) {
  const size_t row_bytes = static_cast<size_t>(image.width) * channel_count;
  uint8_t* packed = image.rgba.data() + image.rgba.size() - row_bytes * image.height;
  if (!read_packed(input, channel_count, image, packed)) return false;
  std::vector<uint8_t> row(row_bytes);
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    std::copy_n(packed + row_bytes * y, row_bytes, row.data());
    expand_row(row.data(), channel_count, image.width,
               &image.rgba[4 * static_cast<size_t>(y) * image.width]);
  }
  return true;
}

Result<Image> decode(std::string_view name, const char* file_name, std::span<const uint8_t> bytes,
                     PixelBudget* budget) {
  static const bool is_set = OIIO::attribute("try_all_readers", 0);
  (void)is_set;
  OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
  OIIO::ImageSpec config, spec;
  config["oiio:UnassociatedAlpha"] = 1;
  void* proxy = &memory;
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
  // ImageInput::open would not do: it may read the bytes first, and the DDS reader does not rewind.
  const auto input = OIIO::ImageInput::create(file_name, false, &config, &memory, "");
  if (!input) return malformed(name, OIIO::geterror());
  memory.seek(0);
  if (!input->open(file_name, spec, config)) return malformed(name, input->geterror());
  input->threads(1);  // without it, OpenImageIO makes a thread pool of its own
  VOXELD_TRY(check_image_size(name, spec.width, spec.height));
  if (spec.depth > 1 || spec.nchannels < 1 || spec.nchannels > 4) {
    return Error{ErrorCode::kMalformedImage, std::string(name) + ": channels of the image",
                 "1 to 4", std::to_string(spec.nchannels)};
  }
  if (budget != nullptr) VOXELD_TRY(budget->take(name, spec.width, spec.height, bytes.size()));
  Image image{.name = std::string(name), .width = spec.width, .height = spec.height, .rgba = {}};
  image.rgba.resize(4 * static_cast<size_t>(spec.width) * spec.height);
  const int channel_count = spec.nchannels;
  const bool is_linear = std::string_view(file_name) == "image.hdr";
  const bool ok = is_linear ? read_linear(*input, channel_count, image)
                            : read_bytes(*input, channel_count, image);
  if (!ok) return malformed(name, input->geterror());
  return image;
}

Result<Image> decode_guarded(std::string_view name, const char* file_name,
                             std::span<const uint8_t> bytes, PixelBudget* budget) {
  try {
    return decode(name, file_name, bytes, budget);
  } catch (const std::exception& e) {
    return malformed(name, e.what());
  }
}

}  // namespace
}  // namespace voxeld

VOXELD_PUBLISH(voxeld_decode_image, voxeld::decode_guarded)
