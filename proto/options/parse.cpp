// Parsing of options by the table: names, lengths and values of single options here, the rules
// across options in rules.h.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "proto/client_texts.h"
#include "proto/edit_distance.h"
#include "proto/options/options.h"
#include "proto/options/rules.h"
#include "proto/options/table.h"
#include "proto/options/values.h"

namespace voxeld {
namespace {

Error unknown_option(std::string_view name, OptionScope scope) {
  const std::string_view shown = name.substr(0, 40);
  std::vector<std::pair<size_t, std::string_view>> near;
  for (const Option& option : option_table()) {
    if (option.applies_to(scope)) near.emplace_back(edit_distance(shown, option.name), option.name);
  }
  std::ranges::stable_sort(near, {}, [](const auto& entry) { return entry.first; });
  std::string expected = "one of";
  for (size_t i = 0; i < near.size() && i < 3; ++i) {
    expected += (i == 0 ? " " : ", ") + std::string(near[i].second);
  }
  return {ErrorCode::kUnknownOption,
          find_option(name) ? "option does not apply to this request" : "no such option",
          expected + ", …", "\"" + std::string(shown) + "\""};
}

// Cuts the text: a client can send anything in place of an option's name.
std::string shown_name(std::string_view name) {
  return std::string(name.substr(0, kEchoBytesMax));
}

Result<std::string> text_of(std::string_view name, const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return std::string(value.get<bool>() ? "yes" : "no");
  if (value.is_number_integer()) return value.dump();
  if (value.is_number()) return option_values::to_text(value.get<double>());
  const std::string expected = "a text, a number or a list of them";
  if (value.is_array() && !value.empty()) {
    std::string text;
    for (const auto& element : value) {
      if (element.is_array() || element.is_object()) {
        return Error{ErrorCode::kInvalidOption, shown_name(name), expected,
                     element.is_array() ? "a list in a list" : "an object in a list"};
      }
      VOXELD_ASSIGN(const std::string part, text_of(name, element));
      if (&element != &value.front()) text += ",";
      text += part;
    }
    return text;
  }
  return Error{ErrorCode::kInvalidOption, shown_name(name), expected,
               std::string(value.type_name())};
}

}  // namespace

Result<RequestOptions> parse_options(const OptionPairs& pairs, OptionScope scope) {
  RequestOptions options;
  GivenOptions given;
  for (const auto& [name, text] : pairs) {
    const Option* const option = find_option(name);
    if (option == nullptr || !option->applies_to(scope)) return unknown_option(name, scope);
    if (!given.insert(option->name).second) {
      return Error{ErrorCode::kInvalidOption, name, "to be given once", "it twice"};
    }
    VOXELD_TRY(check_length({option->name, option->bytes_max}, text));
    VOXELD_TRY(option->codec.parse(options, option->name, text));
  }
  VOXELD_TRY(apply_option_rules(options, scope, given));
  return options;
}

Result<RequestOptions> parse_options(const nlohmann::json& object, OptionScope scope) {
  if (!object.is_object()) {
    return Error{ErrorCode::kInvalidOption, "options", "an object", object.type_name()};
  }
  OptionPairs pairs;
  for (const auto& [name, value] : object.items()) {
    VOXELD_ASSIGN(std::string text, text_of(name, value));
    pairs.emplace_back(name, std::move(text));
  }
  return parse_options(pairs, scope);
}

}  // namespace voxeld
