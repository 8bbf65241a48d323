// Parsing of options by the table: names, lengths and values of single options here, the rules
// across options in rules.h.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "proto/options/options.h"
#include "proto/options/rules.h"
#include "proto/options/table.h"
#include "proto/options/values.h"
#include "proto/text/client_texts.h"
#include "proto/text/near_miss.h"

namespace voxeld {
namespace {

Error unknown_option(std::string_view name, OptionScope scope) {
  if (const Option* elsewhere = find_option(name)) return option_does_not_apply(*elsewhere);
  std::vector<std::string_view> known;
  for (const Option& option : option_table()) {
    if (option.applies_to(scope)) known.push_back(option.name);
  }
  return unknown_name("option", name, known);
}

// The JSON values that an option takes, as an error names them.
std::string_view expected_type(const OptionValues& values) {
  if (std::holds_alternative<NumberListValues>(values)) return "a list of numbers, or a text";
  if (std::holds_alternative<WordListValues>(values)) return "a list of words, or a text";
  const auto* text = std::get_if<TextValues>(&values);
  if (text != nullptr && !text->takes_integer) return "a text";
  return "a text or a number";
}

// Whether the option takes the value, which is no list.
bool takes_scalar(const OptionValues& values, const nlohmann::json& value) {
  if (value.is_string()) return true;
  if (value.is_boolean()) {
    const auto* words = std::get_if<WordValues>(&values);
    return words != nullptr && std::ranges::find(words->words, "yes") != words->words.end();
  }
  if (!value.is_number()) return false;
  if (const auto* list = std::get_if<NumberListValues>(&values)) return list->takes_one;
  if (const auto* text = std::get_if<TextValues>(&values)) {
    const double number = value.get<double>();
    return text->takes_integer && number >= 0 && number == std::floor(number);
  }
  return !std::holds_alternative<WordListValues>(values);
}

bool takes_list(const OptionValues& values, const nlohmann::json& list) {
  if (list.empty()) return false;
  if (std::holds_alternative<NumberListValues>(values)) {
    return std::ranges::all_of(list, [](const nlohmann::json& one) { return one.is_number(); });
  }
  return std::holds_alternative<WordListValues>(values) &&
         std::ranges::all_of(list, [](const nlohmann::json& one) { return one.is_string(); });
}

std::string scalar_text(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  return value.is_number_integer() ? value.dump() : option_values::to_text(value.get<double>());
}

// The text that stands for the value in a query.
Result<std::string> text_of(const Option& option, const nlohmann::json& value) {
  const OptionValues& values = option.codec.values;
  if (takes_scalar(values, value)) return scalar_text(value);
  if (!value.is_array() || !takes_list(values, value)) {
    return Error{ErrorCode::kInvalidOption, std::string(option.name),
                 std::string(expected_type(values)), value.type_name()};
  }
  std::string text;
  for (const nlohmann::json& one : value) {
    if (&one != &value.front()) text += ",";
    text += scalar_text(one);
  }
  return text;
}

// The option of this name, if requests of the scope take it.
Result<const Option*> option_of(std::string_view name, OptionScope scope) {
  const Option* const option = find_option(name);
  if (option == nullptr || !option->applies_to(scope)) return unknown_option(name, scope);
  return option;
}

}  // namespace

Result<RequestOptions> parse_options(const OptionPairs& pairs, OptionScope scope) {
  RequestOptions options;
  GivenOptions given;
  for (const auto& [name, text] : pairs) {
    VOXELD_ASSIGN(const Option* const option, option_of(name, scope));
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
    VOXELD_ASSIGN(const Option* const option, option_of(name, scope));
    VOXELD_ASSIGN(std::string text, text_of(*option, value));
    pairs.emplace_back(name, std::move(text));
  }
  return parse_options(pairs, scope);
}

}  // namespace voxeld
