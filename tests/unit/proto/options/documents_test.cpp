// docs/options.md and openapi.yaml have the options of the table. Their parts between the markers
// "options: WHAT" and "options: end" are compared with what the table gives; VOXELD_RENEW=1 writes
// them anew. WHAT is one of
//   tables            the tables of docs/options.md, one per group
//   parameters        the components of openapi.yaml, one per option
//   list NAME ... [without NAME ...]
//                     references to them; NAME is a scope, a group or an option
//   grid types        media types of grids and sequences (proto/output_format.h)
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "proto/options/table.h"
#include "proto/options/values.h"
#include "proto/output_format.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;
using Lines = std::vector<std::string>;

constexpr std::pair<OptionScope, const char*> kScopes[] = {
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
  if (option.scopes.size() == std::size(kScopes)) return "every request";
  std::string names;
  for (const auto& [scope, name] : kScopes) {
    if (option.applies_to(scope)) names += (names.empty() ? "" : ", ") + std::string(name);
  }
  return names;
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
      if (option.scopes.size() != first.scopes.size()) {
        text = sentence(text) + " Taken by " + scope_names(option) + ".";
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

std::string schema(const Option& option) {
  std::string text;
  const OptionValues& values = option.codec.values;
  if (const auto* integers = std::get_if<IntegerValues>(&values)) {
    text = "type: integer, minimum: " + std::to_string(integers->min) +
           ", maximum: " + std::to_string(integers->max);
  } else if (const auto* numbers = std::get_if<NumberValues>(&values)) {
    text = "type: number, minimum: " + option_values::to_text(numbers->min) +
           ", maximum: " + option_values::to_text(numbers->max);
  } else if (const auto* words = std::get_if<WordValues>(&values)) {
    text = "enum: " + replaced(Json(words->words).dump(), ",", ", ");
  } else {
    text = "type: string, maxLength: " + std::to_string(option.bytes_max);
  }
  const std::string value = default_text(option);
  if (!option.default_words.empty() || value.empty()) return text;
  const bool is_number = !range_text(option).empty();
  return text + ", default: " + (is_number ? value : Json(value).dump());
}

Lines parameters() {
  Lines lines;
  for (const Option& option : option_table()) {
    const std::string name(option.name);
    std::string text = description(option);
    if (std::holds_alternative<TextValues>(option.codec.values)) {
      text = form_text(option) + ": " + text;
    }
    if (!option.default_words.empty()) {
      text = sentence(text) + " Default: " + option.default_words + ".";
    }
    lines.push_back(name + ": {name: " + name + ", in: query, schema: {" + schema(option) +
                    "}, description: " + Json(text).dump() + "}");
  }
  return lines;
}

// Whether a scope, a group or an option of this name has the option.
bool has(const std::string& name, const Option& option) {
  for (const auto& [scope, text] : kScopes) {
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
  if (what == "grid") return grid_types();
  EXPECT_EQ(what, "list");
  return references(words);
}

std::string read_file(const std::string& path) {
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
  const std::string path = VOXELD_SOURCE_DIR "/" + name;
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
  expect_current("proto/openapi.yaml", 17);
}

}  // namespace
}  // namespace voxeld
