// The registry of options. One entry per option gives its name, the requests that take it, the
// member that holds it, its values, its default and its help. Parsing, canonical JSON, the CLI's
// flags and help, docs/options.md and the parameters of openapi.yaml follow from the entries.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "proto/text/client_texts.h"

namespace voxeld {

// The groups in which documents list options.
enum class OptionGroup {
  kPlacement,
  kVoxelization,
  kAnimation,
  kOutput,
  kSelection,  // all by which a result's voxels differ from those of the grid that a job stores
  kImage,
  kSeveralImages,
  kRequest
};

// The texts that an option takes, for help and schemas. The codec's parse() decides.
struct IntegerValues {
  int min, max;
};
struct NumberValues {
  double min, max;
};
struct WordValues {
  std::vector<std::string_view> words;
};
// Numbers with commas between them; in JSON also an array.
struct NumberListValues {
  int count_min = 1, count_max = 1;
  bool is_integer = false;
  double min = -std::numeric_limits<double>::infinity();  // of each
  double max = std::numeric_limits<double>::infinity();
  bool excludes_min = false;
  bool takes_one = false;  // one number stands for all
};
// Words with commas between them; in JSON also an array.
struct WordListValues {
  std::vector<std::string_view> words;
  std::string_view pattern = {};  // of words beside those: one of ECMA 262, unanchored
};
// A text of its own form.
struct TextValues {
  std::string_view pattern = {};  // regular expression of ECMA 262; empty: any text
  bool takes_integer = false;     // JSON may have an integer from 0 on in its place
};
using OptionValues = std::variant<IntegerValues, NumberValues, WordValues, NumberListValues,
                                  WordListValues, TextValues>;

// A value as text: nothing if the member is unset.
using OptionText = std::variant<std::monostate, int, std::string>;

// Reads an option's text into its member and writes it back. codecs.h makes them.
struct OptionCodec {
  OptionValues values;
  // Errors: invalid-option with the name, the expected and the given value.
  std::function<Status(RequestOptions&, std::string_view name, std::string_view text)> parse;
  std::function<OptionText(const RequestOptions&)> write;
};

struct Option {
  std::string_view name;  // "voxel_size"; as a flag --voxel-size
  std::string form = {};  // the form of its text: "S | X,Y,Z"; empty: as `codec.values` tells
  OptionCodec codec = {};
  std::string help = {};     // a noun phrase without markup, for every document
  std::string details = {};  // sentences in CommonMark, for docs/options.md and openapi.yaml
  // The default in words, if it is not the value of a default RequestOptions.
  std::string default_words = {};
  // Whether canonical JSON has the member, if it is set. Null: always.
  bool (*is_written)(const RequestOptions&) = nullptr;
  size_t bytes_max = client_texts::kOption.bytes_max;  // of its text
  OptionGroup group = OptionGroup::kRequest;
  std::span<const OptionScope> scopes = {};  // the requests that take it

  bool applies_to(OptionScope scope) const;
};

// All options, in the order of help texts.
std::span<const Option> option_table();
// Null for an unknown name.
const Option* find_option(std::string_view name);
// unknown-option: "option 'frames' does not apply to this request".
Error option_does_not_apply(const Option& option);

// Texts for documents.
std::string form_text(const Option& option);     // "N", "y | z", "NX,NY,NZ"
std::string range_text(const Option& option);    // "1 to 16384"; empty: not a number
std::string default_text(const Option& option);  // "128"; empty: none
std::string flag_help(const Option& option);     // "voxels … (1 to 16384; default: 128)"

}  // namespace voxeld
