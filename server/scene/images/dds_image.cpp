// The first image of a DirectDraw Surface: its largest level, the first face of a cube map
// (Microsoft, "Programming Guide for DDS").
//
//   0    "DDS "             4   u32 124, bytes of the header   12  u32 height   16  u32 width
//   24   u32 depth          76  u32 32, bytes of the pixel format             80  u32 its flags
//   84   four letters       88  u32 bits of a pixel            92  u32 masks of R, G, B, A
//   112  u32 kind           128 pixels; or with the letters DX10:
//   128  u32 DXGI format    132 u32 dimension                  148 pixels
//
// Numbers are little endian. Rows have no padding. The pitch at 20 is wrong in many files, as the
// guide says, and is not read.
#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>

#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/bc_block.h"
#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

constexpr size_t kDdsHeaderBytes = 128, kDx10HeaderBytes = 148;
constexpr uint32_t kFlagAlpha = 0x1, kFlagLetters = 0x4, kFlagRgb = 0x40, kFlagGrey = 0x20000;
constexpr uint32_t kVolume = 0x200000;
constexpr uint32_t kDimension1d = 2, kDimension2d = 3;

// How pixels are stored: in blocks, or by masks of a little-endian number.
struct Layout {
  std::optional<BcKind> block = std::nullopt;  // else masks
  uint32_t bits = 0;
  std::array<uint32_t, 4> masks{};  // of R, G, B, A; 0: none
  bool is_grey = false;             // the first channel stands for all three
  bool is_multiplied = false;       // colours by alpha
};

constexpr Layout kBc1{.block = BcKind::kBc1};
constexpr Layout kBc2{.block = BcKind::kBc2};
constexpr Layout kBc3{.block = BcKind::kBc3};
constexpr Layout kBc4{.block = BcKind::kBc4};
constexpr Layout kBc5{.block = BcKind::kBc5};
constexpr Layout kRgba8{.bits = 32, .masks = {0xff, 0xff00, 0xff0000, 0xff000000}};
constexpr Layout kBgra8{.bits = 32, .masks = {0xff0000, 0xff00, 0xff, 0xff000000}};
constexpr Layout kBgrx8{.bits = 32, .masks = {0xff0000, 0xff00, 0xff, 0}};
constexpr Layout kRg8{.bits = 16, .masks = {0xff, 0xff00, 0, 0}};
constexpr Layout kR8{.bits = 8, .masks = {0xff, 0, 0, 0}, .is_grey = true};
constexpr Layout kBgr565{.bits = 16, .masks = {0xf800, 0x7e0, 0x1f, 0}};
constexpr Layout kBgr5a1{.bits = 16, .masks = {0x7c00, 0x3e0, 0x1f, 0x8000}};
constexpr Layout kBgra4{.bits = 16, .masks = {0xf00, 0xf0, 0xf, 0xf000}};

struct LetterFormat {
  std::string_view letters;
  Layout layout;
};
// DXT2 and DXT4 have colours multiplied by alpha.
constexpr LetterFormat kLetterFormats[] = {
    {"DXT1", kBc1}, {"DXT2", {.block = BcKind::kBc2, .is_multiplied = true}},
    {"DXT3", kBc2}, {"DXT4", {.block = BcKind::kBc3, .is_multiplied = true}},
    {"DXT5", kBc3}, {"ATI1", kBc4},
    {"BC4U", kBc4}, {"ATI2", kBc5},
    {"BC5U", kBc5}};

// DXGI_FORMAT: ranges of typeless, linear and sRGB forms. Colours are sRGB in all of them, as in
// files of other formats.
struct DxgiFormat {
  uint32_t first, last;
  Layout layout;
};
constexpr DxgiFormat kDxgiFormats[] = {
    {27, 29, kRgba8}, {48, 49, kRg8},   {60, 61, kR8},    {70, 72, kBc1},    {73, 75, kBc2},
    {76, 78, kBc3},   {79, 80, kBc4},   {82, 83, kBc5},   {85, 85, kBgr565}, {86, 86, kBgr5a1},
    {87, 87, kBgra8}, {88, 88, kBgrx8}, {90, 91, kBgra8}, {92, 93, kBgrx8},  {115, 115, kBgra4}};

struct NamedDxgi {
  uint32_t first, last;
  const char* name;
};
constexpr NamedDxgi kUnreadDxgi[] = {
    {81, 81, "BC4 with signs"}, {84, 84, "BC5 with signs"}, {94, 96, "BC6H"}, {97, 99, "BC7"}};

// The caller has checked that the bytes are there.
uint32_t u32_at(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<uint32_t>(little_endian(bytes.subspan(at, 4)));
}

std::string_view letters_of(std::span<const uint8_t> bytes) {
  return as_text(bytes).substr(84, 4);
}

bool has_long_header(std::span<const uint8_t> bytes) {
  return (u32_at(bytes, 80) & kFlagLetters) != 0 && letters_of(bytes) == "DX10";
}

Error unread(std::string_view name, std::string got) {
  return {ErrorCode::kUnsupportedFeature, std::string(name) + ": pixels of the DDS",
          "BC1 to BC5 without signs, or RGB, RGBA or grey of up to 8 bits a channel",
          std::move(got)};
}

std::string dxgi_name(uint32_t format) {
  for (const NamedDxgi& known : kUnreadDxgi) {
    if (format >= known.first && format <= known.last) return known.name;
  }
  return "DXGI format " + std::to_string(format);
}

Result<Layout> dxgi_layout(std::string_view name, std::span<const uint8_t> bytes) {
  if (bytes.size() < kDx10HeaderBytes) return cut_off_image(name, kDx10HeaderBytes, bytes.size());
  const uint32_t format = u32_at(bytes, 128), dimension = u32_at(bytes, 132);
  if (dimension != kDimension1d && dimension != kDimension2d) {
    return unread(name, "DXGI dimension " + std::to_string(dimension));
  }
  for (const DxgiFormat& known : kDxgiFormats) {
    if (format >= known.first && format <= known.last) return known.layout;
  }
  return unread(name, dxgi_name(format));
}

bool is_contiguous(uint32_t mask) {
  return mask == 0 || std::popcount(mask) == 32 - std::countl_zero(mask) - std::countr_zero(mask);
}

Result<Layout> mask_layout(std::string_view name, std::span<const uint8_t> bytes, uint32_t flags) {
  Layout layout{.bits = u32_at(bytes, 88)};
  for (size_t c = 0; c < 4; ++c) layout.masks[c] = u32_at(bytes, 92 + 4 * c);
  if ((flags & kFlagAlpha) == 0) layout.masks[3] = 0;
  if ((flags & kFlagGrey) != 0) layout.is_grey = true;
  const bool is_read =
      layout.bits == 8 || layout.bits == 16 || layout.bits == 24 || layout.bits == 32;
  if (!is_read) return unread(name, std::to_string(layout.bits) + " bits a pixel");
  for (const uint32_t mask : layout.masks) {
    if (!is_contiguous(mask) || std::popcount(mask) > 8 ||
        (layout.bits < 32 && mask >> layout.bits != 0)) {
      return unread(name, "the mask " + std::to_string(mask) + " in " +
                              std::to_string(layout.bits) + " bits");
    }
  }
  return layout;
}

Result<Layout> parse_layout(std::string_view name, std::span<const uint8_t> bytes) {
  const uint32_t flags = u32_at(bytes, 80);
  if ((flags & kFlagLetters) != 0) {
    if (has_long_header(bytes)) return dxgi_layout(name, bytes);
    const std::string_view letters = letters_of(bytes);
    for (const LetterFormat& known : kLetterFormats) {
      if (letters == known.letters) return known.layout;
    }
    return unread(name, shown(letters));
  }
  if ((flags & (kFlagRgb | kFlagGrey)) != 0) return mask_layout(name, bytes, flags);
  return unread(name, "flags " + std::to_string(flags));
}

uint64_t pixel_bytes(const Layout& layout, uint64_t width, uint64_t height) {
  if (!layout.block) return width * height * layout.bits / 8;
  return (width + 3) / 4 * ((height + 3) / 4) * bc_block_bytes(*layout.block);
}

// Reads blocks from left to right, from top to bottom. Those at the edges reach beyond the image.
void read_blocks(BcKind kind, const uint8_t* from, Image& image) {
  std::array<uint8_t, 4 * kBcPixels> block;
  for (int top = 0; top < image.height; top += kBcSide) {
    cancel_point();
    for (int left = 0; left < image.width; left += kBcSide) {
      decode_bc_block(kind, from, block.data());
      from += bc_block_bytes(kind);
      const int columns = std::min(kBcSide, image.width - left);
      for (int y = 0; y < std::min(kBcSide, image.height - top); ++y) {
        const uint8_t* const row = &block[size_t{4} * kBcSide * static_cast<size_t>(y)];
        std::copy_n(row, 4 * columns, image_row(image, top + y) + 4 * ptrdiff_t{left});
      }
    }
  }
}

// A channel's bits, stretched to 0..255.
uint8_t channel(uint32_t pixel, uint32_t mask, uint8_t missing) {
  if (mask == 0) return missing;
  const int shift = std::countr_zero(mask);
  const uint32_t largest = mask >> shift;
  return static_cast<uint8_t>((((pixel & mask) >> shift) * 255 + largest / 2) / largest);
}

void read_masked(const Layout& layout, const uint8_t* from, Image& image) {
  const size_t bytes = layout.bits / 8;
  for (int y = 0; y < image.height; ++y) {
    cancel_point();
    uint8_t* to = image_row(image, y);
    for (int x = 0; x < image.width; ++x, to += 4, from += bytes) {
      const auto pixel = static_cast<uint32_t>(little_endian({from, bytes}));
      for (size_t c = 0; c < 4; ++c) {
        to[c] = channel(pixel, layout.masks[c], c < 3 ? uint8_t{0} : uint8_t{255});
      }
      if (layout.is_grey) to[1] = to[2] = to[0];
    }
  }
}

}  // namespace

Result<Image> decode_dds(std::string_view name, std::span<const uint8_t> bytes,
                         PixelBudget* budget) {
  if (bytes.size() < kDdsHeaderBytes) return cut_off_image(name, kDdsHeaderBytes, bytes.size());
  if (u32_at(bytes, 4) != 124 || u32_at(bytes, 76) != 32) {
    return malformed_image(name, "the DDS header has other sizes than 124 and 32 bytes");
  }
  const int64_t height = u32_at(bytes, 12), width = u32_at(bytes, 16);
  VOXELD_TRY(check_image_size(name, width, height));
  if ((u32_at(bytes, 112) & kVolume) != 0) return unread(name, "a volume");
  VOXELD_ASSIGN(const Layout layout, parse_layout(name, bytes));
  const size_t pixels_at = has_long_header(bytes) ? kDx10HeaderBytes : kDdsHeaderBytes;
  const uint64_t needed =
      pixels_at + pixel_bytes(layout, static_cast<uint64_t>(width), static_cast<uint64_t>(height));
  if (bytes.size() < needed) return cut_off_image(name, needed, bytes.size());
  VOXELD_ASSIGN(Image image, begin_image(name, width, height, bytes.size(), budget));
  if (layout.block) {
    read_blocks(*layout.block, &bytes[pixels_at], image);
  } else {
    read_masked(layout, &bytes[pixels_at], image);
  }
  if (layout.is_multiplied) make_alpha_straight(image.rgba);
  return image;
}

}  // namespace voxeld
