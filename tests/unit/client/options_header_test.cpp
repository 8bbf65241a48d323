// voxeld/options.h has a setter for every option of the table, and an enumeration for every set of
// words. Its parts between "options: WHAT" and "options: end" are compared with what the table
// gives; VOXELD_RENEW=1 writes them anew. WHAT is one of
//   words     enumerations with their names
//   setters   members of class Options
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "proto/options/table.h"
#include "tests/folders.h"

namespace voxeld::test {
namespace {

using Lines = std::vector<std::string>;
using Words = std::vector<std::string_view>;

std::filesystem::path header_path() {
  return source_dir() / "client/include/voxeld/options.h";
}

constexpr size_t kColumns = 100;

constexpr std::pair<OptionGroup, const char*> kGroups[] = {
    {OptionGroup::kPlacement, "placement"},          {OptionGroup::kVoxelization, "voxelization"},
    {OptionGroup::kAnimation, "animation"},          {OptionGroup::kOutput, "output"},
    {OptionGroup::kSelection, "selection"},          {OptionGroup::kImage, "image"},
    {OptionGroup::kSeveralImages, "several images"}, {OptionGroup::kRequest, "request"}};

// "root_motion": "RootMotion".
std::string camel_case(std::string_view name) {
  std::string text;
  bool is_first = true;
  for (const char c : name) {
    if (c != '_' && c != '-') text += is_first ? static_cast<char>(std::toupper(c)) : c;
    is_first = c == '_' || c == '-';
  }
  return text;
}

// The enumeration of an option's words. Those without an entry here are named as the option.
std::string enum_name(const Option& option) {
  static const std::map<std::string_view, std::string> names = {
      {"axes", "AxisOrder"},   {"channels", "Channel"}, {"color", "ColorMode"},
      {"dtype", "DType"},      {"image", "ImageKind"},  {"compress", "MeshCompression"},
      {"labels", "LabelKind"}, {"mirror", "Axis"},      {"layout", "ArrayLayout"},
      {"mesh", "MeshSurface"}, {"up", "UpAxis"}};
  const auto found = names.find(option.name);
  return found == names.end() ? camel_case(option.name) : found->second;
}

// The words of an enumeration; none: the option has no enumeration.
Words words_of(const Option& option) {
  if (const auto* values = std::get_if<WordValues>(&option.codec.values)) {
    return values->words == Words{"yes", "no"} ? Words() : values->words;
  }
  const auto* list = std::get_if<WordListValues>(&option.codec.values);
  return list != nullptr && list->pattern.empty() ? list->words : Words();
}

// `line`, the parts joined by ", ", and `after`: broken at the columns and indented below.
Lines broken(std::string line, const Lines& parts, const std::string& after, size_t indent) {
  Lines lines;
  for (const std::string& part : parts) {
    const std::string text = part + (&part == &parts.back() ? after : ",");
    if (line.size() + 1 + text.size() > kColumns) {
      while (line.ends_with(' ')) line.pop_back();
      lines.push_back(std::exchange(line, std::string(indent, ' ')));
    }
    line += (line.ends_with(',') ? " " : "") + text;
  }
  lines.push_back(line);
  return lines;
}

void append(Lines& lines, const Lines& more) {
  lines.insert(lines.end(), more.begin(), more.end());
}

Lines enumeration(const std::string& name, const Words& words) {
  Lines enumerators, texts;
  for (const std::string_view word : words) {
    enumerators.push_back("k" + camel_case(word));
    texts.push_back("\"" + std::string(word) + "\"");
  }
  Lines lines = broken("enum class " + name + " { ", enumerators, " };", 4);
  lines.push_back("constexpr std::string_view name_of(" + name + " value) {");
  append(lines, broken("  constexpr std::string_view kNames[] = {", texts, "};", 6));
  lines.emplace_back("  return kNames[static_cast<std::size_t>(value)];");
  lines.emplace_back("}");
  return lines;
}

Lines enumerations() {
  Lines lines;
  std::map<std::string, Words> made;
  for (const Option& option : option_table()) {
    const Words words = words_of(option);
    if (words.empty()) continue;
    const std::string name = enum_name(option);
    if (const auto [known, is_new] = made.emplace(name, words); !is_new) {
      EXPECT_EQ(known->second, words) << name << " of option " << option.name;
      continue;
    }
    append(lines, enumeration(name, words));
  }
  return lines;
}

// The parameter of a setter and the value that it stores.
struct Setter {
  std::string parameter, value;
};

// The setters of an option.
struct Setters {
  std::vector<Setter> operator()(const IntegerValues&) const {
    return {{"int value", "text(value)"}};
  }
  std::vector<Setter> operator()(const NumberValues&) const {
    return {{"double value", "text(value)"}};
  }
  std::vector<Setter> operator()(const WordValues&) const {
    if (words_of(option).empty()) {
      // Not bool, which would take the text "no" as true.
      return {{"std::same_as<bool> auto value", "text(value)"}};
    }
    return {{enum_name(option) + " value", "std::string(name_of(value))"}};
  }
  std::vector<Setter> operator()(const NumberListValues& values) const {
    const std::string number = values.is_integer ? "int" : "double";
    const bool is_fixed = values.count_min == values.count_max || values.takes_one;
    const std::string list =
        is_fixed ? "std::array<" + number + ", " + std::to_string(values.count_max) + ">"
                 : "std::vector<" + number + ">";
    std::vector<Setter> setters = {
        {"const " + list + "& values", "text(std::span<const " + number + ">(values))"}};
    if (values.takes_one) setters.push_back({number + " value", "text(value)"});
    return setters;
  }
  std::vector<Setter> operator()(const WordListValues& values) const {
    const std::string word = values.pattern.empty() ? enum_name(option) : "std::string";
    return {{"const std::vector<" + word + ">& values", "text(values)"}};
  }
  std::vector<Setter> operator()(const TextValues& values) const {
    // A text would make {{1, 2}} ambiguous.
    if (option.name == "remap") {
      return {{"const std::vector<std::pair<int, int>>& values", "text(values)"}};
    }
    std::vector<Setter> setters = {{"std::string value", "std::move(value)"}};
    if (values.takes_integer) setters.push_back({"int value", "text(value)"});
    return setters;
  }

  const Option& option;
};

// "// form: help (range; default)", broken at the columns.
Lines comment_of(const Option& option) {
  const OptionValues& values = option.codec.values;
  const bool has_form = std::holds_alternative<TextValues>(values) ||
                        std::holds_alternative<NumberListValues>(values);
  std::istringstream words((has_form ? form_text(option) + ": " : "") + flag_help(option));
  Lines lines;
  std::string line = "//";
  for (std::string word; words >> word;) {
    if (line.size() + 1 + word.size() > kColumns - 2) lines.push_back(std::exchange(line, "//"));
    line += " " + word;
  }
  lines.push_back(line);
  return lines;
}

Lines setters() {
  Lines lines;
  const OptionGroup* group = nullptr;
  for (const Option& option : option_table()) {
    if (group == nullptr || *group != option.group) {
      if (group != nullptr) lines.emplace_back();
      const auto* named =
          std::ranges::find(kGroups, option.group, [](auto& one) { return one.first; });
      lines.push_back("// --- " + std::string(named->second));
    }
    group = &option.group;
    append(lines, comment_of(option));
    const std::string name(option.name);
    for (const Setter& setter : std::visit(Setters{option}, option.codec.values)) {
      const std::string head = "Options& " + name + "(" + setter.parameter + ") {";
      const std::string body = "return set(\"" + name + "\", " + setter.value + ");";
      if (head.size() + body.size() + 3 <= kColumns - 2) {
        lines.push_back(head + " " + body + " }");
      } else {
        append(lines, {head, "  " + body, "}"});
      }
    }
  }
  return lines;
}

std::string read_header() {
  std::ifstream file(header_path());
  EXPECT_TRUE(file) << header_path();
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string renewed(const std::string& header) {
  constexpr std::string_view kMarker = "// options: ";
  std::istringstream lines(header);
  std::string out;
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    const size_t start = line.find_first_not_of(' ');
    const bool is_marker = start != std::string::npos && line.compare(start, 12, kMarker) == 0;
    if (is_marker || !inside) out += line + "\n";
    if (!is_marker) continue;
    const std::string what = line.substr(start + kMarker.size());
    EXPECT_NE(inside, what != "end") << line;
    inside = what != "end";
    if (!inside) continue;
    EXPECT_TRUE(what == "words" || what == "setters") << line;
    for (const std::string& made : what == "words" ? enumerations() : setters()) {
      out += (made.empty() ? "" : std::string(start, ' ') + made) + "\n";
    }
  }
  EXPECT_FALSE(inside) << "a part without an end";
  return out;
}

TEST(OptionsHeader, has_every_option_of_the_table) {
  const std::string header = read_header();
  for (const char* part : {"\n// options: words\n", "\n  // options: setters\n"}) {
    EXPECT_NE(header.find(part), std::string::npos) << "no part " << part;
  }
  const std::string expected = renewed(header);
  if (header == expected) return;
  if (std::getenv("VOXELD_RENEW") != nullptr) {
    std::ofstream(header_path()) << expected;
    return;
  }
  std::istringstream left(header), right(expected);
  std::string got, wanted;
  int number = 0;
  do {
    got = wanted = "(end)";
    std::getline(left, got);
    std::getline(right, wanted);
    ++number;
  } while (got == wanted);
  ADD_FAILURE() << header_path() << " line " << number
                << " is not what the table of options gives.\nis:    " << got
                << "\ntable: " << wanted
                << "\nVOXELD_RENEW=1 unit_client --gtest_filter='OptionsHeader.*' writes it anew.";
}

}  // namespace
}  // namespace voxeld::test
