// Numbers in the texts of clients, files and databases, and ranges of numbers in errors.
#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace voxeld {

// The whole of `text` as a decimal number; nullopt for any other text, as an empty one, one with
// blanks or a plus sign, and a number outside the range of T. T is an integer type or double.
template <typename T>
std::optional<T> parse_number(std::string_view text) {
  T value = 0;
  const char* const text_end = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), text_end, value);
  if (error != std::errc() || end != text_end) return std::nullopt;
  return value;
}

// The same for a number in [min, max].
template <typename T>
std::optional<T> parse_number(std::string_view text, T min, T max) {
  const std::optional<T> value = parse_number<T>(text);
  return value && *value >= min && *value <= max ? value : std::nullopt;
}

// A number of decimal digits alone, without a sign.
template <typename T>
std::optional<T> parse_digits(std::string_view text) {
  return text.starts_with('-') ? std::nullopt : parse_number<T>(text);
}

// The range [low, high] in words: "0 to 3"; "-1" where it is the only one.
inline std::string range_text(int64_t low, int64_t high) {
  return low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high);
}

// The range of indices of `count`: "0 to 3", "0", and "none, as there are no frames" for none.
inline std::string index_text(uint64_t count, std::string_view things) {
  if (count == 0) return "none, as there are no " + std::string(things);
  return range_text(0, static_cast<int64_t>(count - 1));
}

}  // namespace voxeld
