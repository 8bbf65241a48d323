// docs/options.md and openapi.yaml have the options of the table. Their parts between the markers
// "options: WHAT" and "options: end" are compared with what the table gives; VOXELD_RENEW=1 writes
// them anew. WHAT is one of
//   tables            the tables of docs/options.md, one per group
//   version           the project's version
//   parameters        the components of openapi.yaml, one per option
//   values            schemas of the options in the JSON of a job
//   members SCOPE     references to them
//   echoed            members of the options in a job's status, with one type each
//   list NAME ... [without NAME ...]
//                     references to them; NAME is a scope, a group or an option
//   grid types        media types of grids and sequences (proto/output_format.h)
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "proto/options/table.h"
#include "proto/options/values.h"
#include "proto/output_format.h"
#include "proto/version.h"
#include "tests/folders.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;
using Lines = std::vector<std::string>;

constexpr std::pair<OptionScope, const char*> kScopeNames[] = {
    {OptionScope::kVoxelize, "voxelize"},
    {OptionScope::kRenderMesh, "render"},
    {OptionScope::kRenderGrid, "render of a grid or sequence"},
    {OptionScope::kExport, "export"}};

constexpr std::pair<OptionGroup, const char*> kGroups[] = {
    {OptionGroup::kPlacement, "placement"},          {OptionGroup::kVoxelization, "voxelization"},
    {OptionGroup::kAnimation, "animation"},          {OptionGroup::kOutput, "output"},
    {OptionGroup::kSelection, "selection"},          {OptionGroup::kImage, "image"},
    {OptionGroup::kSeveralImages, "several-images"}, {OptionGroup::kRequest, "request"}};

std::string sentence(std::string text) {
  return text.ends_with('.') ? text : text + ".";
}

std::string description(const Option& option) {
  return option.details.empty() ? option.help : sentence(option.help) + " " + option.details;
}

// docs/options.md: "**Placement** (voxelize, render)" and a table of the group's options.

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::string scope_names(const Option& option) {
  if (option.scopes.size() == std::size(kScopeNames)) return "every request";
  std::string names;
  for (const auto& [scope, name] : kScopeNames) {
    if (option.applies_to(scope)) names += (names.empty() ? "" : ", ") + std::string(name);
  }
  return names;
}

// The requests that take the option, where they are not those of the first one of its group.
std::string scope_note(const Option& option, const Option& first) {
  std::string more;
  bool is_less = false;
  for (const auto& [scope, name] : kScopeNames) {
    is_less = is_less || (first.applies_to(scope) && !option.applies_to(scope));
    if (!option.applies_to(scope) || first.applies_to(scope)) continue;
    more += (more.empty() ? "" : ", ") + std::string(name);
  }
  if (is_less) return " Taken by " + scope_names(option) + ".";
  return more.empty() ? "" : " Taken by " + more + ", too.";
}

std::string cell_of_values(const Option& option) {
  const std::string range = range_text(option);
  if (!range.empty()) return range;
  return "`" + replaced(form_text(option), " | ", "`, `") + "`";
}

std::string cell_of_default(const Option& option) {
  const std::string value = default_text(option);
  const bool is_code = option.default_words.empty() && !value.empty();
  return is_code ? "`" + value + "`" : value;
}

Lines tables() {
  Lines lines;
  for (const auto& [group, title] : kGroups) {
    const Option& first = *std::ranges::find(option_table(), group,
                                             [](const Option& option) { return option.group; });
    std::string heading = replaced(title, "-", " ");
    heading[0] = static_cast<char>(std::toupper(heading[0]));
    lines.insert(lines.end(), {"**" + heading + "** (" + scope_names(first) + ")", "",
                               "| option | values | default | |", "|---|---|---|---|"});
    for (const Option& option : option_table()) {
      if (option.group != group) continue;
      std::string text = description(option);
      if (const std::string note = scope_note(option, first); !note.empty()) {
        text = sentence(text) + note;
      }
      lines.push_back("| `" + std::string(option.name) + "` | " + cell_of_values(option) + " | " +
                      cell_of_default(option) + " | " + replaced(text, "|", "\\|") + " |");
    }
    lines.emplace_back();
  }
  lines.pop_back();
  return lines;
}

// openapi.yaml. JSON's texts and lists are YAML too.

constexpr const char* kIntegerPattern = "-?[0-9]+";
constexpr const char* kNumberPattern = R"([+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?)";

std::string text_schema(const std::string& pattern) {
  return "type: string, pattern: " + Json("^(" + pattern + ")$").dump();
}

// "1e+30" is a string in YAML 1.1, which has many readers.
std::string yaml_number(double value) {
  std::string text = option_values::to_text(value);
  const size_t exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) {
    text.insert(exponent, ".0");
  }
  return text;
}

std::string number_schema(bool is_integer, double min, double max, bool excludes_min = false) {
  std::string text = is_integer ? "type: integer" : "type: number";
  if (std::isfinite(min)) {
    text += (excludes_min ? ", exclusiveMinimum: " : ", minimum: ") + yaml_number(min);
  }
  if (std::isfinite(max)) text += ", maximum: " + yaml_number(max);
  return text;
}

std::string enum_schema(const std::vector<std::string_view>& words) {
  return "type: string, enum: " + replaced(Json(words).dump(), ",", ", ");
}

// The schemas of an option: of the one JSON type in which it is echoed, then of others that a job's
// JSON may have in its place.
struct Schemas {
  Lines operator()(const IntegerValues& values) const {
    return {number_schema(true, values.min, values.max), text_schema(kIntegerPattern)};
  }
  Lines operator()(const NumberValues& values) const {
    return {number_schema(false, values.min, values.max), text_schema(kNumberPattern)};
  }
  Lines operator()(const WordValues& values) const {
    Lines schemas = {enum_schema(values.words)};
    Json numbers = Json::array();
    for (const std::string_view word : values.words) {
      if (word == "yes") schemas.emplace_back("type: boolean");
      if (const auto number = option_values::parse_int(word)) numbers.push_back(*number);
    }
    if (!numbers.empty()) schemas.push_back("type: integer, enum: " + numbers.dump());
    return schemas;
  }
  Lines operator()(const NumberListValues& values) const {
    const std::string item =
        number_schema(values.is_integer, values.min, values.max, values.excludes_min);
    const std::string pattern = values.is_integer ? kIntegerPattern : kNumberPattern;
    const bool is_fixed = values.count_min == values.count_max;
    const std::string others =
        "(," + pattern + ")" +
        (is_fixed ? "{" + std::to_string(values.count_min - 1) + "}" : std::string("*"));
    Lines schemas = {"type: array, minItems: " + std::to_string(values.count_min) +
                     ", maxItems: " + std::to_string(values.count_max) + ", items: {" + item + "}"};
    if (values.takes_one) schemas.push_back(item);
    schemas.push_back(text_schema(pattern + (values.takes_one ? "(" + others + ")?" : others)));
    return schemas;
  }
  Lines operator()(const WordListValues& values) const {
    if (!values.pattern.empty()) {
      const std::string word(values.pattern);
      return {"type: array, minItems: 1, items: {" + text_schema(word) + "}",
              text_schema(word + "(," + word + ")*")};
    }
    std::string words;
    for (const std::string_view word : values.words) {
      words += (words.empty() ? "" : "|") + std::string(word);
    }
    return {"type: array, minItems: 1, items: {" + enum_schema(values.words) + "}",
            text_schema("(" + words + ")(,(" + words + "))*")};
  }
  Lines operator()(const TextValues& values) const {
    std::string schema = "type: string, maxLength: " + std::to_string(bytes_max);
    if (!values.pattern.empty()) {
      schema += ", pattern: " + Json(std::string(values.pattern)).dump();
    }
    Lines schemas = {schema};
    if (values.takes_integer) schemas.emplace_back("type: integer, minimum: 0");
    return schemas;
  }

  size_t bytes_max;
};

Lines schemas_of(const Option& option) {
  return std::visit(Schemas{option.bytes_max}, option.codec.values);
}

std::string any_of(const Lines& schemas) {
  if (schemas.size() == 1) return schemas[0];
  std::string text = "anyOf: [";
  for (const std::string& schema : schemas)
    text += (schema == schemas[0] ? "{" : ", {") + schema + "}";
  return text + "]";
}

std::string with_default(const std::string& schema, const Option& option) {
  const std::string value = default_text(option);
  if (!option.default_words.empty() || value.empty()) return schema;
  const bool is_number = !range_text(option).empty();
  return schema + ", default: " + (is_number ? value : Json(value).dump());
}

std::string described(const Option& option) {
  std::string text = description(option);
  const OptionValues& values = option.codec.values;
  if (std::holds_alternative<TextValues>(values) ||
      std::holds_alternative<NumberListValues>(values)) {
    text = form_text(option) + ": " + text;
  }
  if (!option.default_words.empty()) {
    text = sentence(text) + " Default: " + option.default_words + ".";
  }
  return "description: " + Json(text).dump();
}

// A list is one text with commas; a number that stands for a list is a text as well.
Lines parameters() {
  Lines lines;
  for (const Option& option : option_table()) {
    const std::string name(option.name);
    const auto* list = std::get_if<NumberListValues>(&option.codec.values);
    const bool is_list =
        list != nullptr || std::holds_alternative<WordListValues>(option.codec.values);
    Lines schemas = schemas_of(option);
    schemas.resize(list != nullptr && list->takes_one ? 2 : 1);
    lines.push_back(name + ": {name: " + name + ", in: query, " +
                    (is_list ? "style: form, explode: false, " : "") + "schema: {" +
                    with_default(any_of(schemas), option) + "}, " + described(option) + "}");
  }
  return lines;
}

// "voxel_size" as the name of a schema: "VoxelSizeOption".
std::string schema_name(const Option& option) {
  std::string name;
  bool is_first = true;
  for (const char c : option.name) {
    if (c != '_') name += is_first ? static_cast<char>(std::toupper(c)) : c;
    is_first = c == '_';
  }
  return name + "Option";
}

// The schemas of options in the JSON of a job.
Lines value_schemas() {
  Lines lines;
  for (const Option& option : option_table()) {
    lines.push_back(schema_name(option) + ": {" + with_default(any_of(schemas_of(option)), option) +
                    ", " + described(option) + "}");
  }
  return lines;
}

Lines members(const std::string& scope_name) {
  Lines lines;
  for (const Option& option : option_table()) {
    const auto is_named = [&](const auto& scope) {
      return scope.second == scope_name && option.applies_to(scope.first);
    };
    if (!std::ranges::any_of(kScopeNames, is_named)) continue;
    lines.push_back(std::string(option.name) + ": {$ref: \"#/components/schemas/" +
                    schema_name(option) + "\"}");
  }
  EXPECT_FALSE(lines.empty()) << scope_name;
  return lines;
}

Lines echoed() {
  Lines lines;
  for (const Option& option : option_table()) {
    if (option.name == "cache" || option.name == "filename") continue;  // decide no result
    // A text whose default is a number is echoed as either.
    const bool is_either = std::holds_alternative<TextValues>(option.codec.values) &&
                           std::holds_alternative<int>(option.codec.write(RequestOptions{}));
    lines.push_back(std::string(option.name) + ": {" +
                    (is_either ? any_of(schemas_of(option)) : schemas_of(option)[0]) + "}");
  }
  return lines;
}

// Whether a scope, a group or an option of this name has the option.
bool has(const std::string& name, const Option& option) {
  for (const auto& [scope, text] : kScopeNames) {
    if (text == name && option.applies_to(scope)) return true;
  }
  for (const auto& [group, text] : kGroups) {
    if (text == name && option.group == group) return true;
  }
  return option.name == name;
}

bool is_known(const std::string& name) {
  return std::ranges::any_of(option_table(), [&](const Option& one) { return has(name, one); });
}

Lines references(std::istringstream& words) {
  Lines taken, excluded;
  Lines* names = &taken;
  for (std::string word; words >> word && word != "-->";) {
    if (word == "without") {
      names = &excluded;
      continue;
    }
    EXPECT_TRUE(is_known(word)) << word;
    names->push_back(word);
  }
  Lines lines;
  for (const Option& option : option_table()) {
    const auto is_in = [&](const std::string& name) { return has(name, option); };
    if (!std::ranges::any_of(taken, is_in) || std::ranges::any_of(excluded, is_in)) continue;
    lines.push_back("- {$ref: \"#/components/parameters/" + std::string(option.name) + "\"}");
  }
  return lines;
}

Lines grid_types() {
  Lines lines;
  for (const FormatInfo& info : output_formats()) {
    for (const std::string_view type : {info.media_type, info.sequence_media_type}) {
      const std::string line = std::string(type) + ": {}";
      if (std::ranges::find(lines, line) == lines.end()) lines.push_back(line);
    }
  }
  return lines;
}

Lines part(const std::string& marker) {
  std::istringstream words(marker);
  std::string what;
  words >> what;
  if (what == "tables") return tables();
  if (what == "parameters") return parameters();
  if (what == "values") return value_schemas();
  if (what == "echoed") return echoed();
  if (what == "version") return {"version: " + std::string(version())};
  if (what == "grid") return grid_types();
  if (what == "members") {
    words >> what;
    return members(what);
  }
  EXPECT_EQ(what, "list");
  return references(words);
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file), {}};
}

// The document with its parts as the table gives them, and the number of parts.
std::pair<std::string, int> renewed(const std::string& document) {
  constexpr std::string_view kMarker = "options: ";
  std::istringstream lines(document);
  std::string out;
  int count = 0;
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    const size_t start = line.find_first_not_of(' ');
    const size_t marker = line.find(kMarker);
    const bool is_comment = start != std::string::npos &&
                            (line.compare(start, 2, "# ") == 0 || line.starts_with("<!-- "));
    if (!is_comment || marker == std::string::npos) {
      if (!inside) out += line + "\n";
      continue;
    }
    const std::string what = line.substr(marker + kMarker.size());
    EXPECT_NE(inside, !what.starts_with("end")) << line;
    inside = !what.starts_with("end");
    out += line + "\n";
    if (!inside) continue;
    ++count;
    for (const std::string& made : part(what)) {
      out += (made.empty() ? "" : std::string(start, ' ') + made) + "\n";
    }
  }
  EXPECT_FALSE(inside) << "a part without an end";
  return {out, count};
}

void expect_current(const std::string& name, int parts) {
  const std::filesystem::path path = test::source_dir() / name;
  const std::string document = read_file(path);
  const auto [expected, count] = renewed(document);
  EXPECT_EQ(count, parts) << name;
  if (document == expected) return;
  if (std::getenv("VOXELD_RENEW") != nullptr) {
    std::ofstream(path) << expected;
    return;
  }
  std::istringstream left(document), right(expected);
  std::string got, wanted;
  int number = 0;
  do {
    got = wanted = "(end)";
    std::getline(left, got);
    std::getline(right, wanted);
    ++number;
  } while (got == wanted);
  ADD_FAILURE() << name << " line " << number
                << " is not what the table of options gives.\nis:    " << got
                << "\ntable: " << wanted
                << "\nVOXELD_RENEW=1 unit_proto --gtest_filter='OptionDocuments.*' writes it anew.";
}

TEST(OptionDocuments, page_of_options_has_every_option_of_the_table) {
  expect_current("docs/options.md", 1);
}

TEST(OptionDocuments, openapi_has_every_option_of_the_table_and_the_routes_that_take_it) {
  expect_current("proto/openapi.yaml", 25);
}

}  // namespace
}  // namespace voxeld
