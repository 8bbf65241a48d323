// The text headers of files of voxels: lines, words and numbers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/text/number_text.h"

namespace voxeld::volumes {

// The largest magnitude of a coordinate and the least edge of a voxel, in world units. Sums and
// quotients of such numbers stay far from the ends of double's range.
inline constexpr double kWorldMax = 1e30;
inline constexpr double kVoxelSizeMin = 1e-30;

// Lines of a header that end with LF or CRLF. Binary data may follow any of them.
class HeaderLines {
 public:
  explicit HeaderLines(std::span<const uint8_t> bytes)
      : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}

  // The next line without its end. nullopt: no line ends before the file does.
  std::optional<std::string_view> next() {
    const size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos) return std::nullopt;
    std::string_view line = text_.substr(at_, end - at_);
    if (line.ends_with('\r')) line.remove_suffix(1);
    at_ = end + 1;
    ++number_;
    return line;
  }
  // The byte after the last line.
  size_t at() const { return at_; }
  // That of the last line, from 1 on.
  int64_t number() const { return number_; }

 private:
  std::string_view text_;
  size_t at_ = 0;
  int64_t number_ = 0;
};

// Without blanks at both ends.
inline std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

// The words between blanks. Headers have few; of more than 16, the first 17.
inline std::vector<std::string_view> words_of_line(std::string_view line) {
  constexpr size_t kWordsMax = 17;
  std::vector<std::string_view> words;
  for (line = trimmed(line); !line.empty() && words.size() < kWordsMax; line = trimmed(line)) {
    words.push_back(line.substr(0, line.find_first_of(" \t")));
    line.remove_prefix(words.back().size());
  }
  return words;
}

// A number of at most kWorldMax; nullopt for any other text. A plus sign may come before it.
inline std::optional<double> coordinate(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  return parse_number<double>(word, -kWorldMax, kWorldMax);
}

// Exactly kCount such numbers.
template <size_t kCount>
std::optional<std::array<double, kCount>> coordinates(const std::vector<std::string_view>& words) {
  if (words.size() != kCount) return std::nullopt;
  std::array<double, kCount> numbers{};
  for (size_t i = 0; i < kCount; ++i) {
    const auto number = coordinate(words[i]);
    if (!number) return std::nullopt;
    numbers[i] = *number;
  }
  return numbers;
}

// A text for an error message: in quotes, at most 40 bytes, others than printable ones as dots.
inline std::string shown_text(std::string_view text) {
  constexpr size_t kShownBytes = 40;
  std::string shown = "\"";
  for (const char c : trimmed(text).substr(0, kShownBytes)) shown += c >= ' ' && c <= '~' ? c : '.';
  return shown + "\"";
}

}  // namespace voxeld::volumes
