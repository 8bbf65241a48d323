// The first image of a TIFF by libtiff. Grey and RGB of 8 and 16 bits are read as they are stored.
// libtiff converts the others: palettes, CMYK, YCbCr, fewer bits, planes. Its converter would cut
// 16 bits of grey to 8, drop the alpha of grey, and read tiles of such grey wrongly.
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

constexpr uint32_t kTiffPixelsAtOnce = uint32_t{1} << 20;  // between two cancellation points
// Bytes that libtiff allocates at once: strips and tiles. Those of the largest image of 16 bits
// RGBA in one strip fit. More: malformed-image.
constexpr tmsize_t kBlockBytesMax = tmsize_t{8} * limits::kImagePixelsMax;

// Other compressions bring libraries that no texture needs.
constexpr std::array<uint16_t, 9> kCompressions = {
    COMPRESSION_NONE,      COMPRESSION_CCITTRLE,      COMPRESSION_CCITTFAX3,
    COMPRESSION_CCITTFAX4, COMPRESSION_LZW,           COMPRESSION_JPEG,
    COMPRESSION_PACKBITS,  COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE};

// A file in memory and the first error about it.
struct TiffFile {
  std::span<const uint8_t> bytes;
  uint64_t at = 0;
  std::array<char, 200> message{};
};

tmsize_t read_tiff(thandle_t handle, void* to, tmsize_t count) {
  auto* file = static_cast<TiffFile*>(handle);
  if (count <= 0 || file->at >= file->bytes.size()) return 0;
  const auto taken = std::min(static_cast<uint64_t>(count), file->bytes.size() - file->at);
  std::memcpy(to, file->bytes.data() + file->at, taken);
  file->at += taken;
  return static_cast<tmsize_t>(taken);
}

tmsize_t write_tiff(thandle_t, void*, tmsize_t) {
  return 0;
}

toff_t seek_tiff(thandle_t handle, toff_t offset, int whence) {
  auto* file = static_cast<TiffFile*>(handle);
  if (whence == SEEK_CUR) offset += file->at;
  if (whence == SEEK_END) offset += file->bytes.size();
  return file->at = offset;
}

int close_tiff(thandle_t) {
  return 0;
}

toff_t size_of_tiff(thandle_t handle) {
  return static_cast<TiffFile*>(handle)->bytes.size();
}

int on_tiff_error(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  auto& message = static_cast<TiffFile*>(user)->message;
  if (message[0] == '\0') std::vsnprintf(message.data(), message.size(), format, arguments);
  return 1;  // the global handler, which prints, is not called
}

int on_tiff_warning(TIFF*, void*, const char*, const char*, va_list) {
  return 1;
}

using Tiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

Tiff open_tiff(TiffFile& file) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(
      TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
  if (options == nullptr) return {nullptr, TIFFClose};
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kBlockBytesMax);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_tiff_error, &file);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), on_tiff_warning, &file);
  // m: no memory mapping.
  return {TIFFClientOpenExt("image", "rm", &file, read_tiff, write_tiff, seek_tiff, close_tiff,
                            size_of_tiff, nullptr, nullptr, options.get()),
          TIFFClose};
}

Error tiff_error(std::string_view name, const TiffFile& file) {
  const char* words = file.message.data();
  return malformed_image(name, *words != '\0' ? words : "not a valid TIFF");
}

// Whether the colours were multiplied by alpha. If not, the TIFF is changed to say that they were:
// libtiff multiplies others, and leaves those alone.
bool take_alpha_as_it_is(TIFF* tiff) {
  uint16_t count = 0;
  const uint16_t* kinds = nullptr;
  if (TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &count, &kinds) == 0 || count == 0) {
    return false;
  }
  if (kinds[0] != EXTRASAMPLE_UNASSALPHA) return kinds[0] == EXTRASAMPLE_ASSOCALPHA;
  std::vector<uint16_t> changed(kinds, kinds + count);
  changed[0] = EXTRASAMPLE_ASSOCALPHA;
  TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, count, changed.data());
  return false;
}

// Rows that are decoded at once: whole strips or rows of tiles, as a part costs as much.
uint32_t rows_at_once(TIFF* tiff, const Image& image) {
  uint32_t block = 1;
  if (TIFFIsTiled(tiff) != 0) {
    TIFFGetField(tiff, TIFFTAG_TILELENGTH, &block);
  } else {
    TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &block);
  }
  block = std::clamp(block, 1u, static_cast<uint32_t>(image.height));
  const uint32_t wanted = kTiffPixelsAtOnce / static_cast<uint32_t>(image.width);
  return std::max(block, wanted / block * block);
}

// How the samples of grey and RGB are stored.
struct TiffSamples {
  size_t channel_count = 0;  // of a pixel in the file
  size_t bytes = 1;          // of a channel
  bool is_grey = false;
  bool has_alpha = false;

  size_t pixel_bytes() const { return channel_count * bytes; }
};

// The samples if they need no converter.
std::optional<TiffSamples> plain_samples(TIFF* tiff) {
  uint16_t bits = 0, channels = 0, planes = 0, kind = 0, colors = 0, extra_count = 0;
  const uint16_t* extra = nullptr;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &channels);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planes);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &kind);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &extra_count, &extra);
  const bool has_colors = TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &colors) != 0;
  const bool is_grey = colors == PHOTOMETRIC_MINISBLACK;
  const int color_count = is_grey ? 1 : 3;
  if (!has_colors || (!is_grey && colors != PHOTOMETRIC_RGB) || (bits != 8 && bits != 16) ||
      planes != PLANARCONFIG_CONTIG || kind != SAMPLEFORMAT_UINT || channels < color_count) {
    return std::nullopt;
  }
  // Many programs do not say that a fourth channel is alpha.
  const bool has_alpha = channels > color_count &&
                         (extra_count == 0 || extra[0] != EXTRASAMPLE_UNSPECIFIED || !is_grey);
  return TiffSamples{.channel_count = channels,
                     .bytes = size_t{bits} / 8,
                     .is_grey = is_grey,
                     .has_alpha = has_alpha};
}

uint8_t byte_of(const uint8_t* sample, size_t bytes) {
  if (bytes == 1) return *sample;
  uint16_t value = 0;  // libtiff has put its bytes in the order of this machine
  std::memcpy(&value, sample, 2);
  return static_cast<uint8_t>((value + 128u) / 257u);
}

void convert_row(const TiffSamples& samples, const uint8_t* from, int width, uint8_t* to) {
  for (int x = 0; x < width; ++x, from += samples.pixel_bytes(), to += 4) {
    for (size_t c = 0; c < 3; ++c) {
      to[c] = byte_of(from + (samples.is_grey ? 0 : c * samples.bytes), samples.bytes);
    }
    const size_t alpha_at = (samples.is_grey ? 1 : 3) * samples.bytes;
    to[3] = samples.has_alpha ? byte_of(from + alpha_at, samples.bytes) : uint8_t{255};
  }
}

// Without zeros, as a small file can ask for the largest block.
std::unique_ptr<uint8_t[]> block_of(tmsize_t bytes) {
  if (bytes <= 0 || bytes > kBlockBytesMax) return nullptr;
  return std::make_unique_for_overwrite<uint8_t[]>(static_cast<size_t>(bytes));
}

bool read_strips(TIFF* tiff, const TiffSamples& samples, Image& image) {
  const auto row = block_of(TIFFScanlineSize(tiff));
  if (row == nullptr) return false;
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    if (TIFFReadScanline(tiff, row.get(), static_cast<uint32_t>(y), 0) < 0) return false;
    convert_row(samples, row.get(), image.width, image_row(image, y));
  }
  return true;
}

bool read_tiles(TIFF* tiff, const TiffSamples& samples, Image& image) {
  uint32_t tile_width = 0, tile_height = 0;
  TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &tile_width);
  TIFFGetField(tiff, TIFFTAG_TILELENGTH, &tile_height);
  const tmsize_t row_bytes = TIFFTileRowSize(tiff);
  const auto tile = block_of(TIFFTileSize(tiff));
  if (tile == nullptr || tile_width == 0 || tile_height == 0) return false;
  const auto image_width = static_cast<uint32_t>(image.width);
  const auto image_height = static_cast<uint32_t>(image.height);
  for (uint32_t top = 0; top < image_height; top += std::min(tile_height, image_height - top)) {
    for (uint32_t left = 0; left < image_width; left += std::min(tile_width, image_width - left)) {
      cancel_point();
      if (TIFFReadTile(tiff, tile.get(), left, top, 0, 0) < 0) return false;
      const auto columns = static_cast<int>(std::min(tile_width, image_width - left));
      for (uint32_t y = 0; y < std::min(tile_height, image_height - top); ++y) {
        convert_row(samples, tile.get() + row_bytes * y, columns,
                    image_row(image, static_cast<int>(top + y)) + size_t{4} * left);
      }
    }
  }
  return true;
}

// libtiff's converter to RGBA.
class Converter {
 public:
  Converter(TIFF* tiff, TiffFile& file) {
    std::array<char, 1024> why{};  // the size that libtiff demands
    is_valid_ = TIFFRGBAImageOK(tiff, why.data()) != 0 &&
                TIFFRGBAImageBegin(&state_, tiff, 1, why.data()) != 0;
    if (is_valid_) {
      state_.req_orientation = state_.orientation;  // rows as they are stored
    } else if (file.message[0] == '\0') {
      std::snprintf(file.message.data(), file.message.size(), "%.199s", why.data());
    }
  }
  ~Converter() {
    if (is_valid_) TIFFRGBAImageEnd(&state_);
  }
  Converter(const Converter&) = delete;
  Converter& operator=(const Converter&) = delete;

  bool is_valid() const { return is_valid_; }
  bool read(Image& image, int y, uint32_t rows) {
    state_.row_offset = y;
    // The first of the four bytes is the lowest of the number.
    auto* to = reinterpret_cast<uint32_t*>(image_row(image, y));
    return TIFFRGBAImageGet(&state_, to, static_cast<uint32_t>(image.width), rows) != 0;
  }

 private:
  TIFFRGBAImage state_{};
  bool is_valid_ = false;
};

bool convert(TIFF* tiff, TiffFile& file, Image& image) {
  Converter converter(tiff, file);
  if (!converter.is_valid()) return false;
  const auto height = static_cast<uint32_t>(image.height);
  const uint32_t rows = rows_at_once(tiff, image);
  for (uint32_t y = 0; y < height; y += rows) {
    cancel_point();
    if (!converter.read(image, static_cast<int>(y), std::min(rows, height - y))) return false;
  }
  return true;
}

}  // namespace

Result<Image> decode_tiff(std::string_view name, std::span<const uint8_t> bytes,
                          PixelBudget* budget) {
  TiffFile file{.bytes = bytes};
  const Tiff tiff = open_tiff(file);
  if (tiff == nullptr) return tiff_error(name, file);
  uint32_t width = 0, height = 0;
  uint16_t compression = 0;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_COMPRESSION, &compression);
  if (std::find(kCompressions.begin(), kCompressions.end(), compression) == kCompressions.end()) {
    return Error{ErrorCode::kUnsupportedFeature, std::string(name) + ": compression of the TIFF",
                 "none, LZW, Deflate, JPEG, PackBits or CCITT", std::to_string(compression)};
  }
  VOXELD_ASSIGN(Image image, begin_image(name, width, height, bytes.size(), budget));
  const bool is_multiplied = take_alpha_as_it_is(tiff.get());
  const std::optional<TiffSamples> samples = plain_samples(tiff.get());
  const bool ok = !samples                       ? convert(tiff.get(), file, image)
                  : TIFFIsTiled(tiff.get()) != 0 ? read_tiles(tiff.get(), *samples, image)
                                                 : read_strips(tiff.get(), *samples, image);
  if (!ok || file.message[0] != '\0') return tiff_error(name, file);
  if (is_multiplied) make_alpha_straight(image.rgba);
  return image;
}

}  // namespace voxeld
