#include "server/scene/core/text_cursor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <system_error>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

// Bytes of a number: all digits of any double are some 1100. Longer words are none, because their
// conversion could not be cancelled.
constexpr size_t kNumberTextBytesMax = 4096;

}  // namespace

std::optional<double> parse_number(std::string_view token) {
  if (token.empty() || token.size() > kNumberTextBytesMax) return std::nullopt;
  // from_chars does not accept a plus sign. "+-1" must stay invalid, so its plus is not removed.
  if (token.size() > 1 && token[0] == '+' && token[1] != '-') token.remove_prefix(1);
  double value = 0.0;
  const char* end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  if (stop != end) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // from_chars does not tell overflow from underflow; a negative exponent means underflow.
    const bool tiny = token.find("e-") != token.npos || token.find("E-") != token.npos;
    return tiny ? std::optional<double>(0.0) : std::nullopt;
  }
  if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> parse_number_or_nan(std::string_view token) {
  if (const auto number = parse_number(token)) return number;
  if (token.size() > kNumberTextBytesMax) return std::nullopt;
  if (!token.empty() && (token[0] == '+' || token[0] == '-')) token.remove_prefix(1);
  const auto begins = [&](std::string_view word) {
    return equals_ignoring_case(token.substr(0, word.size()), word);
  };
  // Visual C++ wrote 1.#QNAN, 1.#IND and 1.#INF, and now writes nan(ind).
  bool is_none = (begins("nan") && (token.size() == 3 || token[3] == '(')) ||
                 equals_ignoring_case(token, "inf") || equals_ignoring_case(token, "infinity") ||
                 begins("1.#");
  double value = 0.0;
  const char* end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  is_none = is_none || (stop == end && error == std::errc::result_out_of_range);
  return is_none ? std::optional(std::numeric_limits<double>::quiet_NaN()) : std::nullopt;
}

std::optional<int64_t> parse_integer(std::string_view token) {
  if (token.empty() || token.size() > kNumberTextBytesMax) return std::nullopt;
  if (token.size() > 1 && token[0] == '+' && token[1] != '-') token.remove_prefix(1);
  int64_t value = 0;
  const char* end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  if (error != std::errc()) return std::nullopt;
  if (stop == end) return value;
  const auto number = parse_number(token);
  constexpr double kExactMax = 9007199254740992.0;  // 2^53
  if (!number || std::abs(*number) > kExactMax || *number != std::floor(*number)) {
    return std::nullopt;
  }
  return static_cast<int64_t>(*number);
}

const char* find_newline(const char* at, const char* end) {
  constexpr ptrdiff_t kPieceBytes = ptrdiff_t{1} << 20;  // between two cancellation points
  while (at != end) {
    cancel_point();
    const ptrdiff_t bytes = std::min(end - at, kPieceBytes);
    const void* found = std::memchr(at, '\n', static_cast<size_t>(bytes));
    if (found != nullptr) return static_cast<const char*>(found);
    at += bytes;
  }
  return end;
}

void TextCursor::skip_comment() {
  at_ = find_newline(at_, end_);
}

std::string_view TextCursor::take_word() {
  const char* begin = at_;
  at_ = skipped(at_, end_, [this](char c) {
    return !is_blank(c) && c != '\n' && (comment_ == '\0' || c != comment_);
  });
  token_line_ = line_;
  return {begin, static_cast<size_t>(at_ - begin)};
}

std::string_view TextCursor::token() {
  cancel_point();
  while (at_ != end_) {
    if (*at_ == '\n') {
      ++line_;
      ++at_;
      cancel_point_at(bytes_left());
    } else if (is_blank(*at_)) {
      at_ = skipped(at_, end_, is_blank);
    } else if (comment_ != '\0' && *at_ == comment_) {
      skip_comment();
    } else {
      break;
    }
  }
  return take_word();
}

std::string_view TextCursor::token_on_line() {
  cancel_point();
  at_ = skipped(at_, end_, is_blank);
  if (at_ != end_ && comment_ != '\0' && *at_ == comment_) skip_comment();
  if (at_ == end_ || *at_ == '\n') return {};
  return take_word();
}

std::string_view TextCursor::rest_of_line() {
  cancel_point();
  const char* begin = at_;
  token_line_ = line_;
  const char* stop = find_newline(at_, end_);
  at_ = stop;
  if (at_ != end_) {
    ++at_;
    ++line_;
  }
  return trimmed({begin, static_cast<size_t>(stop - begin)});
}

}  // namespace voxeld
