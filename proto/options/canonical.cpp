// Canonical JSON of options: the text from which result names are made. Every default is spelled
// out, so a changed default in a later version cannot give an old result to a new request.
#include <nlohmann/json.hpp>
#include <variant>

#include "proto/options/table.h"

namespace voxeld {
namespace {

using Json = nlohmann::ordered_json;

void add_member(Json& out, const Option& option, const RequestOptions& options) {
  if (option.is_written != nullptr && !option.is_written(options)) return;
  const OptionText value = option.codec.write(options);
  if (const int* integer = std::get_if<int>(&value)) out[std::string(option.name)] = *integer;
  if (const auto* text = std::get_if<std::string>(&value)) out[std::string(option.name)] = *text;
}

}  // namespace

std::string canonical_json(const RequestOptions& options, OptionScope scope) {
  Json out = Json::object();
  // The selection comes last: members are in the order in which the names of stored results have
  // them.
  for (const bool is_selection : {false, true}) {
    for (const Option& option : option_table()) {
      if ((option.group == OptionGroup::kSelection) != is_selection) continue;
      if (option.applies_to(scope)) add_member(out, option, options);
    }
  }
  return out.dump();
}

}  // namespace voxeld
