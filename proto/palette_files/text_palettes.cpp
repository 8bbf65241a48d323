// Palettes that are text. Lines end with LF, CRLF or CR.
//
//   .gpl   GIMP Palette | Name: … | Columns: … | # comment | R G B name
//          Aseprite's with alpha: Channels: RGBA | R G B A name
//   .pal   JASC-PAL | 0100 | number of colours | R G B
//   .hex   RRGGBB, alone in its line
#include <array>
#include <optional>
#include <string>

#include "proto/palette_files/readers.h"
#include "proto/text/number_text.h"
#include "proto/text/text_file.h"

namespace voxeld::palette_files {
namespace {

constexpr std::string_view kComponents = "red, green and blue from 0 to 255";

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

// Lines without blanks around them, by number.
class Lines {
 public:
  explicit Lines(Bytes bytes) : rest_(plain_text(bytes, storage_)) {}
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  // nullopt after the last line.
  std::optional<std::string_view> next() {
    if (rest_.empty()) return std::nullopt;
    const std::string_view line = rest_.substr(0, rest_.find('\n'));
    rest_.remove_prefix(std::min(rest_.size(), line.size() + 1));
    ++number_;
    return trimmed(line);
  }
  // The next line; empty after the last one.
  std::string_view header() { return next().value_or(std::string_view()); }
  std::string place() const { return "line " + std::to_string(number_); }

 private:
  std::string storage_;
  std::string_view rest_;
  size_t number_ = 0;
};

// Takes the next word of a line.
std::string_view take_word(std::string_view& line) {
  line = trimmed(line);
  size_t length = 0;
  while (length < line.size() && !is_blank(line[length])) ++length;
  const std::string_view word = line.substr(0, length);
  line.remove_prefix(length);
  return word;
}

// The first three words as a colour; what follows them is left in `line`.
std::optional<PaletteColor> take_color(std::string_view& line) {
  PaletteColor color{};
  for (uint8_t& component : color) {
    const auto value = parse_digits<uint8_t>(take_word(line));
    if (!value) return std::nullopt;
    component = *value;
  }
  return color;
}

std::optional<uint8_t> hex_byte(std::string_view digits) {
  uint8_t value = 0;
  const char* const digits_end = digits.data() + digits.size();
  const auto [end, error] = std::from_chars(digits.data(), digits_end, value, 16);
  if (error != std::errc() || end != digits_end) return std::nullopt;
  return value;
}

}  // namespace

Status read_gimp(Bytes bytes, FileColors& colors) {
  Lines lines(bytes);
  const std::string_view first = lines.header();
  if (first != "GIMP Palette") return colors.error(lines.place(), "GIMP Palette", shown(first));
  bool is_header = true, has_alpha = false;
  while (const auto line = lines.next()) {
    if (line->empty() || line->starts_with('#')) continue;
    if (is_header && (line->starts_with("Name:") || line->starts_with("Columns:"))) continue;
    if (is_header && *line == "Channels: RGBA") {
      has_alpha = true;
      continue;
    }
    is_header = false;
    std::string_view rest = *line;
    const auto color = take_color(rest);
    if (!color) return colors.error(lines.place(), std::string(kComponents), shown(*line));
    if (has_alpha && take_word(rest) == "0") continue;
    VOXELD_TRY(colors.add(*color));
  }
  return {};
}

Status read_jasc(Bytes bytes, FileColors& colors) {
  Lines lines(bytes);
  for (const std::string_view expected : {"JASC-PAL", "0100"}) {
    const std::string_view line = lines.header();
    if (line != expected) return colors.error(lines.place(), std::string(expected), shown(line));
  }
  const std::string_view count_text = lines.header();
  const auto count = parse_digits<uint32_t>(count_text);
  if (!count) return colors.error(lines.place(), "the number of colours", shown(count_text));
  size_t read = 0;
  while (const auto line = lines.next()) {
    if (line->empty()) continue;
    std::string_view rest = *line;
    const auto color = take_color(rest);
    if (!color || !trimmed(rest).empty()) {
      return colors.error(lines.place(), std::string(kComponents), shown(*line));
    }
    if (++read > *count) {
      return colors.error(lines.place(), "the " + std::to_string(*count) + " colours of line 3",
                          "more");
    }
    VOXELD_TRY(colors.add(*color));
  }
  if (read == *count) return {};
  return colors.error("", "the " + std::to_string(*count) + " colours of line 3",
                      std::to_string(read));
}

Status read_hex(Bytes bytes, FileColors& colors) {
  Lines lines(bytes);
  while (const auto line = lines.next()) {
    if (line->empty()) continue;
    const std::string_view digits = line->starts_with('#') ? line->substr(1) : *line;
    PaletteColor color{};
    bool is_color = digits.size() == 6;
    for (size_t c = 0; is_color && c < color.size(); ++c) {
      const auto byte = hex_byte(digits.substr(2 * c, 2));
      is_color = byte.has_value();
      color[c] = byte.value_or(0);
    }
    if (!is_color) return colors.error(lines.place(), "six hexadecimal digits", shown(*line));
    VOXELD_TRY(colors.add(color));
  }
  return {};
}

}  // namespace voxeld::palette_files
