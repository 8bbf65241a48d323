#include "proto/options/values.h"
#include "proto/text/number_text.h"

namespace voxeld::option_values {

std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  for (;;) {
    const size_t comma = text.find(',');
    parts.push_back(text.substr(0, comma));
    if (comma == std::string_view::npos) return parts;
    text.remove_prefix(comma + 1);
  }
}

std::optional<int> parse_int(std::string_view text) {
  return parse_number<int>(text);
}

std::optional<double> parse_double(std::string_view text) {
  // from_chars does not accept a plus sign. "+-1" must stay invalid, so its plus is not removed.
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  const auto value = parse_number<double>(text);
  if (!value || !std::isfinite(*value)) return std::nullopt;
  return *value == 0 ? 0.0 : *value;  // -0 and 0 are the same request
}

Result<int> int_between(std::string_view name, std::string_view text, int min, int max) {
  const auto value = parse_int(text);
  if (!value || *value < min || *value > max) {
    return invalid(name, (min == max ? "" : "an integer from ") + range_text(min, max), text);
  }
  return *value;
}

Result<double> number_between(std::string_view name, std::string_view text, double min,
                              double max) {
  const auto value = parse_double(text);
  if (!value || *value < min || *value > max) {
    return invalid(name, "a number from " + to_text(min) + " to " + to_text(max), text);
  }
  return *value;
}

std::string to_text(double value) {
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end};
}

std::string to_text(std::span<const double> values) {
  std::string text;
  for (const double value : values) {
    if (!text.empty()) text += ',';
    text += to_text(value);
  }
  return text;
}

}  // namespace voxeld::option_values
