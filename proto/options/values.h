// Text forms of option values: strict parsing (nothing may follow the value) and canonical writing.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "proto/text/client_texts.h"

namespace voxeld::option_values {

inline Error invalid(std::string_view name, std::string_view expected, std::string_view got) {
  return {ErrorCode::kInvalidOption, std::string(name), std::string(expected), echoed(got)};
}

// Splits at commas; an empty text gives one empty part.
std::vector<std::string_view> split(std::string_view text);

std::optional<int> parse_int(std::string_view text);
// Accepts finite numbers only.
std::optional<double> parse_double(std::string_view text);

Result<int> int_between(std::string_view name, std::string_view text, int min, int max);
Result<double> number_between(std::string_view name, std::string_view text, double min, double max);
// Parses exactly N finite numbers.
template <size_t N>
Result<std::array<double, N>> numbers(std::string_view name, std::string_view text) {
  const auto parts = split(text);
  std::array<double, N> out{};
  for (size_t i = 0; i < N && parts.size() == N; ++i) {
    const auto value = parse_double(parts[i]);
    if (!value) return invalid(name, std::to_string(N) + " finite numbers", text);
    out[i] = *value;
  }
  if (parts.size() != N) return invalid(name, std::to_string(N) + " numbers", text);
  return out;
}

// The shortest text that reads back as the same double.
std::string to_text(double value);
std::string to_text(std::span<const double> values);

// A word of an enumeration; tables list them in the order of the values.
template <typename Enum>
struct Word {
  std::string_view text;
  Enum value;
};
template <typename Enum>
Result<Enum> one_of(std::string_view name, std::string_view text,
                    std::span<const Word<Enum>> words) {
  std::string expected;
  for (const auto& word : words) {
    if (word.text == text) return word.value;
    expected += (expected.empty() ? "" : " | ") + std::string(word.text);
  }
  return invalid(name, expected, text);
}
template <typename Enum>
std::string_view word_of(Enum value, std::span<const Word<Enum>> words) {
  for (const auto& word : words) {
    if (word.value == value) return word.text;
  }
  return {};
}

}  // namespace voxeld::option_values
