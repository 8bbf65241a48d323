// Reads numbers and words from the text of a mesh file, without copies and independent of locales.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"

namespace voxeld {

// The number that is the whole of `token`: decimal, with an optional sign and exponent. Numbers too
// small for a double are 0. Too large ones, "nan" and "inf" are nullopt.
std::optional<double> parse_number(std::string_view token);
// Like parse_number(), but NaN for words that mean no finite number: "nan", "-inf", "1.#QNAN",
// "1e999".
std::optional<double> parse_number_or_nan(std::string_view token);
// The integer that is the whole of `token`. 12.0 is accepted, because some PLY files write it.
std::optional<int64_t> parse_integer(std::string_view token);

// The first character from `at` on that `is_skipped` does not hold for, or `end`.
template <typename IsSkipped>
const char* skipped(const char* at, const char* end, const IsSkipped& is_skipped) {
  constexpr ptrdiff_t kPieceBytes = ptrdiff_t{1} << 16;  // between two cancellation points
  for (;;) {
    const char* const stop = at + std::min(end - at, kPieceBytes);
    while (at != stop && is_skipped(*at)) ++at;
    if (at != stop || at == end) return at;
    cancel_point();
  }
}
// The next newline from `at` on, or `end`.
const char* find_newline(const char* at, const char* end);

// Reads the words of one line from the left.
class LineCursor {
 public:
  explicit LineCursor(std::string_view line) : at_(line.data()), end_(line.data() + line.size()) {}
  // The next word; empty at the end of the line.
  std::string_view token() {
    cancel_point();
    skip_blanks();
    const char* begin = at_;
    at_ = skipped(at_, end_, [](char c) { return !is_blank(c); });
    return {begin, static_cast<size_t>(at_ - begin)};
  }
  // The rest of the line, trimmed.
  std::string_view rest() {
    const std::string_view text(at_, static_cast<size_t>(end_ - at_));
    at_ = end_;
    return trimmed(text);
  }
  bool at_end() {
    skip_blanks();
    return at_ == end_;
  }

 private:
  void skip_blanks() {
    at_ = skipped(at_, end_, [](char c) { return is_blank(c); });
  }
  const char* at_;
  const char* end_;
};

// Reads the words of a text across lines and knows the line of each.
class TextCursor {
 public:
  // `comment`: a character that starts a comment to the end of the line; '\0' for none.
  explicit TextCursor(std::string_view text, char comment = '\0', int64_t first_line = 1)
      : at_(text.empty() ? "" : text.data()),  // memchr must not see a null pointer
        end_(at_ + text.size()),
        line_(first_line),
        token_line_(first_line),
        comment_(comment) {}

  // The next word on this line or a later one; empty at the end of the text.
  std::string_view token();
  // The next word on this line; empty at its end.
  std::string_view token_on_line();
  // The rest of this line, trimmed. Continues on the next line.
  std::string_view rest_of_line();
  // Line of the last word, from 1.
  int64_t line() const { return token_line_; }
  size_t bytes_left() const { return static_cast<size_t>(end_ - at_); }

 private:
  void skip_comment();
  std::string_view take_word();
  const char* at_;
  const char* end_;
  int64_t line_;
  int64_t token_line_;
  char comment_;
};

}  // namespace voxeld
