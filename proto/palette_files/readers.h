// Helpers that the readers of palette files share: lists of colours, and errors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/palette.h"
#include "proto/result.h"

namespace voxeld::palette_files {

using Bytes = std::span<const uint8_t>;

// The colours of one file. Errors begin with its name.
class FileColors {
 public:
  explicit FileColors(std::string_view filename) : filename_(filename) {}

  // Keeps a colour that is not there yet. Errors: more than kPaletteColorsMax.
  Status add(const PaletteColor& color) {
    if (std::ranges::find(colors_, color) != colors_.end()) return {};
    if (colors_.size() == kPaletteColorsMax) {
      return error("", "at most " + std::to_string(kPaletteColorsMax) + " colours", "more");
    }
    colors_.push_back(color);
    return {};
  }
  std::vector<PaletteColor> take() { return std::move(colors_); }

  // "a.gpl line 4: expected …, got …"; without a place only the file.
  Error error(std::string_view place, std::string expected, std::string got) const {
    std::string where = filename_;
    if (!place.empty()) where.append(" ").append(place);
    return {ErrorCode::kInvalidOption, std::move(where), std::move(expected), std::move(got)};
  }

 private:
  std::string filename_;
  std::vector<PaletteColor> colors_;
};

// A place in a binary file, from which numbers are read.
class Cursor {
 public:
  Cursor(Bytes bytes, const FileColors& colors) : bytes_(bytes), colors_(colors) {}

  size_t position() const { return position_; }
  size_t left() const { return bytes_.size() - position_; }
  // Errors: fewer bytes are left; `what` they are.
  Result<Bytes> take(size_t count, std::string_view what) {
    if (left() < count) {
      return error(std::string(what) + " of " + std::to_string(count) + " bytes",
                   std::to_string(left()) + " bytes until the end");
    }
    position_ += count;
    return bytes_.subspan(position_ - count, count);
  }
  Result<uint32_t> big(size_t size, std::string_view what) {
    VOXELD_ASSIGN(const Bytes taken, take(size, what));
    uint32_t value = 0;
    for (const uint8_t byte : taken) value = value << 8 | byte;
    return value;
  }
  Result<uint32_t> little(size_t size, std::string_view what) {
    VOXELD_ASSIGN(const Bytes taken, take(size, what));
    uint32_t value = 0;
    for (size_t i = size; i > 0; --i) value = value << 8 | taken[i - 1];
    return value;
  }
  // An error at this place.
  Error error(std::string expected, std::string got) const {
    return colors_.error("byte " + std::to_string(position_), std::move(expected), std::move(got));
  }

 private:
  Bytes bytes_;
  const FileColors& colors_;
  size_t position_ = 0;
};

// The beginning of a text from a file in quotes, with '?' for what terminals may not show.
std::string shown(std::string_view text);

// Each reads a file whose format is known, and adds its colours.
Status read_gimp(Bytes bytes, FileColors& colors);
Status read_jasc(Bytes bytes, FileColors& colors);
Status read_hex(Bytes bytes, FileColors& colors);
Status read_riff(Bytes bytes, FileColors& colors);
Status read_color_table(Bytes bytes, FileColors& colors);
Status read_color_swatches(Bytes bytes, FileColors& colors);
Status read_swatch_exchange(Bytes bytes, FileColors& colors);
Status read_png(Bytes bytes, FileColors& colors);

}  // namespace voxeld::palette_files
