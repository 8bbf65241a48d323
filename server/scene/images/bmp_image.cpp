// BMP by stb_image, which is compiled into this file alone.
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_BMP
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 32768  // limits::kImageSideMax
#include <stb/stb_image.h>

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

static_assert(STBI_MAX_DIMENSIONS == limits::kImageSideMax);

// The headers, little endian: u32 at 10 offset of the pixels, u32 at 14 bytes of the second header.
// Of 12: u16 at 24 bits. Longer ones: u16 at 28 bits.
constexpr size_t kHeadersBytesMin = 26;
constexpr size_t kFileBytesMin = kHeadersBytesMin + 4;  // and one row
constexpr uint32_t kCoreHeaderBytes = 12;

// The length that the headers of a file of at least kFileBytesMin ask for. stb_image reads zeros
// after the end of a file, so its length is checked beforehand.
uint64_t bytes_needed(std::span<const uint8_t> bytes, int64_t width, int64_t height) {
  const uint64_t pixels_at = little_endian(bytes.subspan(10, 4));
  const bool is_core = little_endian(bytes.subspan(14, 4)) == kCoreHeaderBytes;
  const uint64_t bits = little_endian(bytes.subspan(is_core ? 24 : 28, 2));
  const uint64_t row_bytes = (static_cast<uint64_t>(width) * bits + 31) / 32 * 4;
  return std::max<uint64_t>(pixels_at, kHeadersBytesMin) +
         row_bytes * static_cast<uint64_t>(height);
}

}  // namespace

Result<Image> decode_bmp(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  // The lengths of stb_image are int. A file of the largest size is shorter.
  const int length = static_cast<int>(std::min<size_t>(bytes.size(), INT32_MAX));
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(bytes.data(), length, &width, &height, &channels) == 0) {
    return malformed_image(name, stbi_failure_reason());
  }
  // Rows from top to bottom are marked by a negative height.
  const int64_t row_count = std::abs(int64_t{height});
  VOXELD_TRY(check_image_size(name, width, row_count));
  if (bytes.size() < kFileBytesMin) return cut_off_image(name, kFileBytesMin, bytes.size());
  const uint64_t needed = bytes_needed(bytes, width, row_count);
  if (bytes.size() < needed) return cut_off_image(name, needed, bytes.size());
  VOXELD_ASSIGN(Image image, begin_image(name, width, row_count, bytes.size(), budget));
  cancel_point();  // the next call takes up to half a second
  const std::unique_ptr<stbi_uc, decltype(&std::free)> rgba(
      stbi_load_from_memory(bytes.data(), length, &width, &height, &channels, 4), std::free);
  if (rgba == nullptr) return malformed_image(name, stbi_failure_reason());
  if (width != image.width || height != image.height) {
    return malformed_image(name, "the image has two sizes");
  }
  std::copy_n(rgba.get(), image.rgba.size(), image.rgba.begin());
  return image;
}

}  // namespace voxeld
