// Palettes in bytes.
//
//   RIFF .pal  "RIFF" length "PAL "; chunks of id, length and data, at even places. Chunk "data":
//              version 0x0300, count, then red, green, blue and flags of each. Little-endian.
//   .act       256 x red, green, blue; then, if the file has 772 bytes, the number of colours and
//              the transparent one. Big-endian.
//   .aco       version 1, count, then space and four components of each; a version 2 of the same
//              colours with names may follow, or be alone. Big-endian.
//   .ase       "ASEF" 1.0, number of blocks; blocks of type, length and data. A colour's data:
//              name, model, floats, kind. Big-endian.
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "proto/palette_files/readers.h"
#include "proto/text/text_file.h"

namespace voxeld::palette_files {
namespace {

PaletteColor gray(uint8_t level) {
  return {level, level, level};
}

// --- Adobe color swatches

enum SwatchSpace : uint32_t { kSwatchRgb = 0, kSwatchGray = 8 };

std::string swatch_space_name(uint32_t space) {
  switch (space) {
    case 1:
      return "HSB";
    case 2:
      return "CMYK";
    case 7:
      return "Lab";
    default:
      return "space " + std::to_string(space);
  }
}

Result<PaletteColor> read_swatch(Cursor& cursor) {
  constexpr uint32_t kGrayMax = 10000;
  const Cursor start = cursor;
  VOXELD_ASSIGN(const uint32_t space, cursor.big(2, "a colour's space"));
  std::array<uint32_t, 4> values{};
  for (uint32_t& value : values) {
    VOXELD_ASSIGN(value, cursor.big(2, "a colour's component"));
  }
  if (space == kSwatchRgb) {
    PaletteColor color{};
    for (size_t c = 0; c < color.size(); ++c) {
      color[c] = static_cast<uint8_t>((values[c] * 255 + 32767) / 65535);
    }
    return color;
  }
  if (space != kSwatchGray) {
    return start.error("a colour in RGB or grey", swatch_space_name(space));
  }
  if (values[0] > kGrayMax) {
    return start.error("a grey from 0 to " + std::to_string(kGrayMax), std::to_string(values[0]));
  }
  return gray(static_cast<uint8_t>((values[0] * 255 + kGrayMax / 2) / kGrayMax));
}

// --- Adobe Swatch Exchange

constexpr uint32_t kSwatchColorBlock = 1;

// A float from 0 to 1 as a byte.
Result<uint8_t> read_unit_float(Cursor& cursor) {
  const Cursor start = cursor;
  VOXELD_ASSIGN(const uint32_t bits, cursor.big(4, "a colour's component"));
  const auto value = std::bit_cast<float>(bits);
  if (!(value >= 0 && value <= 1)) {
    return start.error("a component from 0 to 1", std::to_string(value));
  }
  return static_cast<uint8_t>(std::lround(value * 255));
}

Status read_swatch_block(Cursor& cursor, FileColors& colors) {
  VOXELD_ASSIGN(const uint32_t letters, cursor.big(2, "the length of a colour's name"));
  VOXELD_TRY(cursor.take(size_t{2} * letters, "a colour's name"));
  const Cursor start = cursor;
  VOXELD_ASSIGN(const Bytes model, cursor.take(4, "a colour's model"));
  if (as_text(model) == "RGB ") {
    PaletteColor color{};
    for (uint8_t& component : color) {
      VOXELD_ASSIGN(component, read_unit_float(cursor));
    }
    return colors.add(color);
  }
  if (as_text(model) == "Gray") {
    VOXELD_ASSIGN(const uint8_t level, read_unit_float(cursor));
    return colors.add(gray(level));
  }
  return start.error("a colour of model 'RGB ' or 'Gray'", shown(as_text(model)));
}

}  // namespace

Status read_riff(Bytes bytes, FileColors& colors) {
  constexpr uint32_t kVersion = 0x0300;
  constexpr size_t kSignatureBytes = 4;
  Cursor file(bytes, colors);
  VOXELD_TRY(file.take(kSignatureBytes, "the signature"));
  VOXELD_TRY(file.little(4, "the length of the file"));
  const Cursor start = file;
  VOXELD_ASSIGN(const Bytes form, file.take(4, "the form"));
  if (as_text(form) != "PAL ") return start.error("the form 'PAL '", shown(as_text(form)));
  while (true) {
    if (file.left() == 0) return file.error("a chunk 'data'", "the end");
    VOXELD_ASSIGN(const Bytes id, file.take(4, "a chunk's id"));
    VOXELD_ASSIGN(const uint32_t length, file.little(4, "a chunk's length"));
    if (as_text(id) == "data") break;
    VOXELD_TRY(file.take(size_t{length} + length % 2, "a chunk"));
  }
  const Cursor versions = file;
  VOXELD_ASSIGN(const uint32_t version, file.little(2, "the version"));
  if (version != kVersion) {
    return versions.error("version " + std::to_string(kVersion), std::to_string(version));
  }
  VOXELD_ASSIGN(const uint32_t count, file.little(2, "the number of colours"));
  for (uint32_t i = 0; i < count; ++i) {
    VOXELD_ASSIGN(const Bytes entry, file.take(4, "a colour"));
    VOXELD_TRY(colors.add({entry[0], entry[1], entry[2]}));
  }
  return {};
}

Status read_color_table(Bytes bytes, FileColors& colors) {
  constexpr size_t kTableBytes = 768, kLongBytes = 772, kEntries = 256;
  if (bytes.size() != kTableBytes && bytes.size() != kLongBytes) {
    return colors.error("", "768 or 772 bytes", std::to_string(bytes.size()));
  }
  size_t count = kEntries;
  std::optional<uint32_t> transparent;
  if (bytes.size() == kLongBytes) {
    Cursor end(bytes, colors);
    VOXELD_TRY(end.take(kTableBytes, "the colours"));
    const Cursor start = end;
    VOXELD_ASSIGN(const uint32_t given, end.big(2, "the number of colours"));
    if (given == 0 || given > kEntries) {
      return start.error("a number of colours from 1 to 256", std::to_string(given));
    }
    count = given;
    VOXELD_ASSIGN(transparent, end.big(2, "the transparent colour"));
  }
  for (size_t i = 0; i < count; ++i) {
    if (transparent == i) continue;
    VOXELD_TRY(colors.add({bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]}));
  }
  return {};
}

Status read_color_swatches(Bytes bytes, FileColors& colors) {
  Cursor cursor(bytes, colors);
  const Cursor start = cursor;
  VOXELD_ASSIGN(const uint32_t version, cursor.big(2, "the version"));
  if (version != 1 && version != 2) return start.error("version 1 or 2", std::to_string(version));
  VOXELD_ASSIGN(const uint32_t count, cursor.big(2, "the number of colours"));
  for (uint32_t i = 0; i < count; ++i) {
    VOXELD_ASSIGN(const PaletteColor color, read_swatch(cursor));
    VOXELD_TRY(colors.add(color));
    if (version == 1) continue;
    VOXELD_ASSIGN(const uint32_t letters, cursor.big(4, "the length of a colour's name"));
    VOXELD_TRY(cursor.take(size_t{2} * letters, "a colour's name"));
  }
  if (version == 2 || cursor.left() == 0) return {};
  const Cursor second = cursor;
  VOXELD_ASSIGN(const uint32_t next, cursor.big(2, "a version"));
  if (next == 2) return {};
  return second.error("the end, or version 2 of the colours", std::to_string(next));
}

Status read_swatch_exchange(Bytes bytes, FileColors& colors) {
  Cursor cursor(bytes, colors);
  VOXELD_TRY(cursor.take(4, "the signature"));
  const Cursor start = cursor;
  VOXELD_ASSIGN(const uint32_t major, cursor.big(2, "the version"));
  VOXELD_ASSIGN(const uint32_t minor, cursor.big(2, "the version"));
  if (major != 1) {
    return start.error("version 1", std::to_string(major) + "." + std::to_string(minor));
  }
  VOXELD_ASSIGN(const uint32_t blocks, cursor.big(4, "the number of blocks"));
  for (uint32_t i = 0; i < blocks; ++i) {
    VOXELD_ASSIGN(const uint32_t type, cursor.big(2, "a block's type"));
    VOXELD_ASSIGN(const uint32_t length, cursor.big(4, "a block's length"));
    Cursor block = cursor;
    VOXELD_TRY(cursor.take(length, "a block"));
    if (type == kSwatchColorBlock) VOXELD_TRY(read_swatch_block(block, colors));
  }
  return {};
}

}  // namespace voxeld::palette_files
