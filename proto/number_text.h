// Numbers in the texts of clients, files and databases.
#pragma once

#include <charconv>
#include <optional>
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

}  // namespace voxeld
