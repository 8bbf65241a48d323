// The texts of options.
#include "client/include/voxeld/options.h"

#include <algorithm>

#include "proto/options/values.h"

namespace voxeld::client {
namespace {

template <typename Values, typename Text>
std::string joined_text(const Values& values, Text&& text_of_one) {
  std::string joined;
  for (const auto& value : values) {
    if (&value != &values.front()) joined += ',';
    joined += text_of_one(value);
  }
  return joined;
}

}  // namespace

Options& Options::set(std::string name, std::string value) {
  for (auto& pair : pairs_) {
    if (pair.first == name) {
      pair.second = std::move(value);
      return *this;
    }
  }
  pairs_.emplace_back(std::move(name), std::move(value));
  return *this;
}

bool Options::has(std::string_view name) const {
  return std::ranges::any_of(pairs_, [&](const auto& pair) { return pair.first == name; });
}

std::string Options::text(double value) {
  return option_values::to_text(value);
}

std::string Options::text(std::span<const int> values) {
  return joined_text(values, [](int value) { return std::to_string(value); });
}

std::string Options::text(std::span<const double> values) {
  return option_values::to_text(values);
}

std::string Options::text(const std::vector<std::string>& values) {
  return joined_text(values, [](const std::string& value) { return value; });
}

std::string Options::text(const std::vector<std::pair<int, int>>& values) {
  return joined_text(
      values, [](const auto& value) { return text(value.first) + ":" + text(value.second); });
}

}  // namespace voxeld::client
