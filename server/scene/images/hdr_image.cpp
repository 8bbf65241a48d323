// Radiance HDR (G. Ward, "Real Pixels", Graphics Gems II, 1991): three mantissas and their exponent
// for each pixel. It is read here because the libraries return a whole image of floats, 0.8 GB for
// the largest, by one call.
//
//   lines of text, the first "#?RADIANCE" or "#?RGBE", up to an empty one
//   -Y height +X width
//   rows, each in one of two forms
//     runs      u8 2, u8 2, u16 width (big endian), then for each of the four channels: u8 n;
//               n > 128: a byte that is repeated n - 128 times; else n bytes
//     in order  four bytes a pixel; 1 1 1 n repeats the pixel before n times, and n << 8 times if
//               such a pixel follows another
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

constexpr int kRunWidthMin = 8, kRunWidthMax = 32'767;  // others are stored in order
constexpr int kRunLengthMin = 128;
constexpr int kExponentBias = 128 + 8;  // of a mantissa in 1/256
constexpr std::string_view kFormat = "32-bit_rle_rgbe";

struct HdrHeader {
  int64_t width = 0, height = 0;
  size_t pixels_at = 0;
};

Error hdr_error(std::string_view name, std::string_view what, std::string expected,
                std::string got) {
  return {ErrorCode::kMalformedImage, std::string(name) + ": " + std::string(what),
          std::move(expected), std::move(got)};
}

// The size that a line states; nullopt for another line.
std::optional<HdrHeader> parse_size(std::string_view line) {
  LineCursor words(line);
  const std::string_view y = words.token(), rows = words.token();
  const std::string_view x = words.token(), columns = words.token();
  const auto height = parse_integer(rows), width = parse_integer(columns);
  if (y != "-Y" || x != "+X" || !height || !width || !words.at_end()) return std::nullopt;
  return HdrHeader{.width = *width, .height = *height};
}

Result<HdrHeader> parse_header(std::string_view name, std::span<const uint8_t> bytes) {
  const std::string_view text = as_text(bytes);
  bool is_after_empty_line = false;
  for (size_t at = 0; at < text.size();) {
    cancel_point();
    const size_t end = text.find('\n', at);
    if (end == std::string_view::npos) break;
    const std::string_view line = trimmed(text.substr(at, end - at));
    at = end + 1;
    if (is_after_empty_line) {
      std::optional<HdrHeader> header = parse_size(line);
      if (!header) return hdr_error(name, "size of the image", "-Y height +X width", shown(line));
      header->pixels_at = at;
      return *header;
    }
    constexpr std::string_view kKey = "FORMAT=";
    if (line.starts_with(kKey) && line.substr(kKey.size()) != kFormat) {
      return hdr_error(name, "format of the pixels", std::string(kFormat),
                       shown(line.substr(kKey.size())));
    }
    is_after_empty_line = line.empty();
  }
  return hdr_error(name, "the header does not end", "an empty line and -Y height +X width",
                   "the end of the file");
}

uint8_t srgb_byte(float linear) {
  if (!(linear > 0.0f)) return 0;
  const float c = std::min(linear, 1.0f);
  const float encoded = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
  return static_cast<uint8_t>(std::lround(255.0f * encoded));
}

using Rgbe = std::array<uint8_t, 4>;

class RowReader {
 public:
  RowReader(std::string_view name, std::span<const uint8_t> bytes, size_t at)
      : name_(name), bytes_(bytes), at_(at) {}

  Status read(std::vector<Rgbe>& row) {
    const auto width = static_cast<int>(row.size());
    VOXELD_TRY(need(4));
    const uint8_t* head = &bytes_[at_];
    if (width < kRunWidthMin || width > kRunWidthMax || head[0] != 2 || head[1] != 2 ||
        head[2] > 127) {
      return read_in_order(row);
    }
    if ((head[2] << 8 | head[3]) != width) {
      return hdr_error(name_, "byte " + std::to_string(at_ + 2) + ": width of a row",
                       std::to_string(width), std::to_string(head[2] << 8 | head[3]));
    }
    at_ += 4;
    for (size_t channel = 0; channel < 4; ++channel) VOXELD_TRY(read_channel(row, channel));
    return {};
  }

 private:
  Status need(size_t count) const {
    if (count <= bytes_.size() - at_) return {};
    return cut_off_image(name_, at_ + count, bytes_.size());
  }
  Status too_long(size_t left, size_t got) const {
    return hdr_error(name_, "byte " + std::to_string(at_) + ": a run goes beyond its row",
                     "1 to " + std::to_string(left) + " pixels", std::to_string(got));
  }

  Status read_channel(std::vector<Rgbe>& row, size_t channel) {
    for (size_t x = 0; x < row.size();) {
      VOXELD_TRY(need(2));
      const int code = bytes_[at_];
      const bool is_run = code > kRunLengthMin;
      const auto count = static_cast<size_t>(is_run ? code - kRunLengthMin : code);
      if (count == 0 || count > row.size() - x) return too_long(row.size() - x, count);
      ++at_;
      VOXELD_TRY(need(is_run ? 1 : count));
      for (size_t i = 0; i < count; ++i) row[x + i][channel] = bytes_[at_ + (is_run ? 0 : i)];
      x += count;
      at_ += is_run ? 1 : count;
    }
    return {};
  }

  Status read_in_order(std::vector<Rgbe>& row) {
    int shift = 0;
    for (size_t x = 0; x < row.size();) {
      cancel_point();  // n may be 0, so a file of such pixels is one row
      VOXELD_TRY(need(4));
      Rgbe pixel;
      std::memcpy(pixel.data(), &bytes_[at_], 4);
      if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
        row[x++] = last_ = pixel;
        shift = 0;
      } else {
        const size_t count = shift <= 24 ? size_t{pixel[3]} << shift : SIZE_MAX;
        if (count > row.size() - x) return too_long(row.size() - x, count);
        std::fill_n(row.begin() + static_cast<ptrdiff_t>(x), count, last_);
        x += count;
        shift += 8;
      }
      at_ += 4;
    }
    return {};
  }

  std::string_view name_;
  std::span<const uint8_t> bytes_;
  size_t at_;
  Rgbe last_{};
};

}  // namespace

// The colours are linear and unbounded, so they are clamped to 1 and then encoded as sRGB.
Result<Image> decode_hdr(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  VOXELD_ASSIGN(const HdrHeader header, parse_header(name, bytes));
  VOXELD_ASSIGN(Image image, begin_image(name, header.width, header.height, bytes.size(), budget));
  RowReader reader(name, bytes, header.pixels_at);
  std::vector<Rgbe> row(static_cast<size_t>(image.width));
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    VOXELD_TRY(reader.read(row));
    uint8_t* to = image_row(image, y);
    for (const Rgbe& pixel : row) {
      const float unit = pixel[3] == 0 ? 0.0f : std::ldexp(1.0f, pixel[3] - kExponentBias);
      for (size_t c = 0; c < 3; ++c) *to++ = srgb_byte(static_cast<float>(pixel[c]) * unit);
      *to++ = 255;
    }
  }
  return image;
}

}  // namespace voxeld
