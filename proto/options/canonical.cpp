// Canonical JSON of options: the text from which result names are made. Every default is spelled
// out, so a changed default in a later version cannot give an old result to a new request.
#include <nlohmann/json.hpp>
#include <string>
#include <variant>

#include "proto/options/table.h"

namespace voxeld {
namespace {

// As text, since a tree of JSON needs memory again when it is destroyed, and ends the process where
// there is none.
void add_member(std::string& out, const Option& option, const RequestOptions& options) {
  if (option.is_written != nullptr && !option.is_written(options)) return;
  const OptionText value = option.codec.write(options);
  const int* integer = std::get_if<int>(&value);
  const auto* text = std::get_if<std::string>(&value);
  if (integer == nullptr && text == nullptr) return;
  out.append(out.size() == 1 ? "\"" : ",\"").append(option.name).append("\":");
  out += integer != nullptr ? std::to_string(*integer) : nlohmann::json(*text).dump();
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
