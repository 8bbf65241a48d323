// Canonical JSON of options: the text from which result names are made. Every default is spelled
// out, so a changed default in a later version cannot give an old result to a new request.
#include <nlohmann/json.hpp>
#include <string>
#include <variant>

#include "proto/options/table.h"
#include "proto/options/values.h"

namespace voxeld {
namespace {

// The value in its only JSON type: a number, a list or a text.
std::string value_json(const Option& option, const std::string& text) {
  const OptionValues& values = option.codec.values;
  if (std::holds_alternative<NumberValues>(values)) return text;
  if (std::holds_alternative<NumberListValues>(values)) return "[" + text + "]";
  if (!std::holds_alternative<WordListValues>(values)) return nlohmann::json(text).dump();
  std::string list = "[";
  for (const std::string_view word : option_values::split(text)) {
    list.append(list.size() == 1 ? "\"" : ",\"").append(word).append("\"");
  }
  return list + "]";
}

// As text, since a tree of JSON needs memory again when it is destroyed, and ends the process where
// there is none.
void add_member(std::string& out, const Option& option, const RequestOptions& options) {
  if (option.is_written != nullptr && !option.is_written(options)) return;
  const OptionText value = option.codec.write(options);
  const int* integer = std::get_if<int>(&value);
  const auto* text = std::get_if<std::string>(&value);
  if (integer == nullptr && text == nullptr) return;
  out.append(out.size() == 1 ? "\"" : ",\"").append(option.name).append("\":");
  out += integer != nullptr ? std::to_string(*integer) : value_json(option, *text);
}

}  // namespace

std::string canonical_json(const RequestOptions& options, OptionScope scope) {
  std::string out = "{";
  // The selection comes last: members are in the order in which the names of stored results have
  // them.
  for (const bool is_selection : {false, true}) {
    for (const Option& option : option_table()) {
      if ((option.group == OptionGroup::kSelection) != is_selection) continue;
      if (option.applies_to(scope)) add_member(out, option, options);
    }
  }
  return out.append("}");
}

}  // namespace voxeld
