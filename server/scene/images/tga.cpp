#include "server/scene/images/tga.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

// Header, little endian:
//   0 u8 id bytes   1 u8 has palette   2 u8 type   3 u16 first palette entry   5 u16 entries
//   7 u8 bits of an entry   8 u16 x   10 u16 y   12 u16 width   14 u16 height   16 u8 bits
//   17 u8 descriptor: 0-3 alpha bits, 4 right to left, 5 top to bottom, 6-7 zero
constexpr size_t kHeaderBytes = 18;
constexpr size_t kPixelsAtOnce = size_t{1} << 20;  // between two cancel points

enum Type { kPalette = 1, kColor = 2, kGrey = 3 };
constexpr int kRunLength = 8;  // added to Type

using Rgba = std::array<uint8_t, 4>;

struct Header {
  size_t id_bytes = 0;
  bool has_palette = false;
  int type = 0;  // Type, without kRunLength
  bool is_run_length = false;
  int palette_first = 0, palette_count = 0, palette_bits = 0;
  int width = 0, height = 0, bits = 0, alpha_bits = 0;
  bool right_to_left = false, top_to_bottom = false;
};

int u16_at(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<int>(little_endian(bytes.subspan(at, 2)));
}

Error malformed(std::string_view name, size_t at, std::string_view what, std::string expected = {},
                std::string got = {}) {
  return {ErrorCode::kMalformedImage,
          std::string(name) + " byte " + std::to_string(at) + ": " + std::string(what),
          std::move(expected), std::move(got)};
}

bool is_color_bits(int bits) {
  return bits == 15 || bits == 16 || bits == 24 || bits == 32;
}

// Reads the header; nullopt if its fields contradict each other.
std::optional<Header> parse_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < kHeaderBytes || bytes[1] > 1 || bytes[17] >> 6 != 0) return std::nullopt;
  Header h;
  h.id_bytes = bytes[0];
  h.has_palette = bytes[1] == 1;
  h.is_run_length = (bytes[2] & kRunLength) != 0;
  h.type = bytes[2] & ~kRunLength;
  h.palette_first = u16_at(bytes, 3);
  h.palette_count = u16_at(bytes, 5);
  h.palette_bits = bytes[7];
  h.width = u16_at(bytes, 12);
  h.height = u16_at(bytes, 14);
  h.bits = bytes[16];
  h.alpha_bits = bytes[17] & 15;
  h.right_to_left = (bytes[17] & 16) != 0;
  h.top_to_bottom = (bytes[17] & 32) != 0;
  const bool fits = (h.type == kPalette && h.has_palette && (h.bits == 8 || h.bits == 16)) ||
                    (h.type == kColor && is_color_bits(h.bits)) ||
                    (h.type == kGrey && (h.bits == 8 || h.bits == 16));
  if (!fits || (h.has_palette && !is_color_bits(h.palette_bits))) return std::nullopt;
  return h;
}

size_t bytes_of(int bits) {
  return static_cast<size_t>(bits + 7) / 8;
}

uint8_t from_5_bits(int value) {
  return static_cast<uint8_t>((value * 255 + 15) / 31);
}

Rgba color_at(const uint8_t* at, int bits, int alpha_bits) {
  if (bits == 24 || bits == 32) {
    return {at[2], at[1], at[0], bits == 32 && alpha_bits > 0 ? at[3] : uint8_t{255}};
  }
  const int value = at[0] | at[1] << 8;  // A1 R5 G5 B5
  const bool is_clear = bits == 16 && alpha_bits == 1 && value >> 15 == 0;
  return {from_5_bits(value >> 10 & 31), from_5_bits(value >> 5 & 31), from_5_bits(value & 31),
          is_clear ? uint8_t{0} : uint8_t{255}};
}

class Reader {
 public:
  Reader(std::string_view name, const Header& header, std::span<const uint8_t> bytes)
      : name_(name), header_(header), bytes_(bytes), at_(kHeaderBytes + header.id_bytes) {}

  Result<Image> read() {
    VOXELD_TRY(read_palette());
    const size_t pixel_count = static_cast<size_t>(header_.width) * header_.height;
    const size_t pixel_bytes = bytes_of(header_.bits);
    // A packet of 1 + pixel_bytes makes at most 128 pixels. Memory is allocated only if the file
    // can hold enough packets.
    const size_t fewest = header_.is_run_length ? (pixel_count + 127) / 128 * (1 + pixel_bytes)
                                                : pixel_count * pixel_bytes;
    VOXELD_TRY(need(fewest));
    Image image{
        .name = std::string(name_), .width = header_.width, .height = header_.height, .rgba = {}};
    resize_in_pieces(image.rgba, 4 * pixel_count);
    size_t done = 0;
    while (done < pixel_count) {
      cancel_point();
      size_t count = std::min(pixel_count - done, kPixelsAtOnce);
      bool is_run = false;
      if (header_.is_run_length) {
        VOXELD_TRY(need(1));
        is_run = (bytes_[at_] & 128) != 0;
        count = size_t{1} + (bytes_[at_] & 127);
        ++at_;
      }
      if (count > pixel_count - done) {
        return malformed(name_, at_ - 1, "a packet goes beyond the image",
                         "at most " + std::to_string(pixel_count - done) + " pixels",
                         std::to_string(count));
      }
      VOXELD_TRY(need(is_run ? pixel_bytes : count * pixel_bytes));
      Rgba pixel{};
      for (size_t i = 0; i < count; ++i) {
        if (i == 0 || !is_run) {
          VOXELD_ASSIGN(pixel, next_pixel());
        }
        put(image, done + i, pixel);
      }
      done += count;
    }
    return image;
  }

 private:
  Status need(size_t count) const {
    if (at_ <= bytes_.size() && count <= bytes_.size() - at_) return {};
    return malformed(name_, std::min(at_, bytes_.size()), "the image is cut off",
                     std::to_string(count) + " bytes",
                     std::to_string(bytes_.size() - std::min(at_, bytes_.size())) + " bytes");
  }

  Status read_palette() {
    VOXELD_TRY(need(0));
    if (!header_.has_palette) return {};
    const size_t entry_bytes = bytes_of(header_.palette_bits);
    VOXELD_TRY(need(header_.palette_count * entry_bytes));
    for (int i = 0; i < header_.palette_count; ++i) {
      // Palettes have no alpha depth of their own; entries of 32 bits count as having 8.
      palette_.push_back(color_at(&bytes_[at_], header_.palette_bits,
                                  header_.palette_bits == 32 ? 8 : header_.alpha_bits));
      at_ += entry_bytes;
    }
    return {};
  }

  // The caller has checked with need() that the bytes are there.
  Result<Rgba> next_pixel() {
    const uint8_t* at = &bytes_[at_];
    const size_t begin = at_;
    at_ += bytes_of(header_.bits);
    if (header_.type == kColor) return color_at(at, header_.bits, header_.alpha_bits);
    if (header_.type == kGrey) {
      return Rgba{at[0], at[0], at[0], header_.bits == 16 ? at[1] : uint8_t{255}};
    }
    const int index = (header_.bits == 16 ? at[0] | at[1] << 8 : at[0]) - header_.palette_first;
    if (index < 0 || index >= header_.palette_count) {
      return malformed(name_, begin, "palette index out of range",
                       std::to_string(header_.palette_first) + " and the " +
                           std::to_string(header_.palette_count - 1) + " after it",
                       std::to_string(index + header_.palette_first));
    }
    return palette_[static_cast<size_t>(index)];
  }

  void put(Image& image, size_t number, const Rgba& pixel) const {
    size_t x = number % static_cast<size_t>(image.width);
    size_t y = number / static_cast<size_t>(image.width);
    if (header_.right_to_left) x = static_cast<size_t>(image.width) - 1 - x;
    if (!header_.top_to_bottom) y = static_cast<size_t>(image.height) - 1 - y;
    std::copy(pixel.begin(), pixel.end(),
              image.rgba.begin() + 4 * (y * static_cast<size_t>(image.width) + x));
  }

  std::string_view name_;
  const Header& header_;
  std::span<const uint8_t> bytes_;
  size_t at_;
  std::vector<Rgba> palette_;
};

}  // namespace

bool looks_like_tga(std::span<const uint8_t> bytes) {
  return parse_header(bytes).has_value();
}

Result<Image> decode_tga(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  const std::optional<Header> header = parse_header(bytes);
  if (!header) return malformed(name, 0, "no TGA header");
  VOXELD_TRY(check_image_size(name, header->width, header->height));
  if (budget != nullptr) {
    VOXELD_TRY(budget->take(name, header->width, header->height, bytes.size()));
  }
  return Reader(name, *header, bytes).read();
}

}  // namespace voxeld
