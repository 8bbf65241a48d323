// The names of fields are compared in lower case and without blanks, as teem does. The
// specification: http://teem.sourceforge.net/nrrd/format.html
#include "server/volumes/nrrd_fields.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <glm/common.hpp>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/volumes/header_text.h"
#include "server/volumes/volume_error.h"

namespace voxeld::volumes {
namespace {

// The part of a direction's length by which it may leave its axis. Programs compute directions from
// angles, so that zeros become numbers like 1e-17.
constexpr double kDirectionRounding = 1e-6;

constexpr std::string_view kNrrdRead[] = {
    "type",     "dimension", "sizes",    "encoding",       "endian",
    "spacings", "kinds",     "space",    "spacedimension", "spaceorigin",
    "lineskip", "byteskip",  "datafile", "spacedirections"};
constexpr std::string_view kNrrdSkipped[] = {
    "blocksize",   "content",  "min",      "max",        "oldmin",          "oldmax",
    "number",      "labels",   "units",    "centers",    "centerings",      "thicknesses",
    "sampleunits", "axismins", "axismaxs", "spaceunits", "measurementframe"};

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

bool is_among(std::string_view word, std::span<const std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}

// The name of a field as the specification has it.
std::string_view spelled(std::string_view field) {
  if (field == "spacedirections") return "space directions";
  if (field == "spaceorigin") return "space origin";
  if (field == "lineskip") return "line skip";
  return field == "byteskip" ? "byte skip" : field;
}

std::optional<SampleType> nrrd_sample_type(std::string_view word) {
  constexpr std::pair<std::string_view, SampleType> kTypes[] = {
      {"signed char", SampleType::kInt8},
      {"int8", SampleType::kInt8},
      {"int8_t", SampleType::kInt8},
      {"uchar", SampleType::kUint8},
      {"unsigned char", SampleType::kUint8},
      {"uint8", SampleType::kUint8},
      {"uint8_t", SampleType::kUint8},
      {"short", SampleType::kInt16},
      {"short int", SampleType::kInt16},
      {"signed short", SampleType::kInt16},
      {"signed short int", SampleType::kInt16},
      {"int16", SampleType::kInt16},
      {"int16_t", SampleType::kInt16},
      {"ushort", SampleType::kUint16},
      {"unsigned short", SampleType::kUint16},
      {"unsigned short int", SampleType::kUint16},
      {"uint16", SampleType::kUint16},
      {"uint16_t", SampleType::kUint16},
      {"int", SampleType::kInt32},
      {"signed int", SampleType::kInt32},
      {"int32", SampleType::kInt32},
      {"int32_t", SampleType::kInt32},
      {"uint", SampleType::kUint32},
      {"unsigned int", SampleType::kUint32},
      {"uint32", SampleType::kUint32},
      {"uint32_t", SampleType::kUint32},
      {"longlong", SampleType::kInt64},
      {"long long", SampleType::kInt64},
      {"long long int", SampleType::kInt64},
      {"signed long long", SampleType::kInt64},
      {"signed long long int", SampleType::kInt64},
      {"int64", SampleType::kInt64},
      {"int64_t", SampleType::kInt64},
      {"ulonglong", SampleType::kUint64},
      {"unsigned long long", SampleType::kUint64},
      {"unsigned long long int", SampleType::kUint64},
      {"uint64", SampleType::kUint64},
      {"uint64_t", SampleType::kUint64},
      {"float", SampleType::kFloat32},
      {"double", SampleType::kFloat64}};
  for (const auto& [spelling, type] : kTypes) {
    if (spelling == word) return type;
  }
  return std::nullopt;
}

// The vectors of a line, as "(1,0,0) none (0, 2, 0)": nullopt for "none".
class NrrdVectors {
 public:
  using Vectors = std::vector<std::optional<glm::dvec3>>;

  explicit NrrdVectors(std::string_view text) : text_(text) {}

  // nullopt: it has something else, or more than 16 of them.
  std::optional<Vectors> read() {
    constexpr size_t kVectorsMax = 16;
    Vectors vectors;
    for (text_ = trimmed(text_); !text_.empty(); text_ = trimmed(text_)) {
      if (vectors.size() == kVectorsMax) return std::nullopt;
      if (text_.starts_with("none")) {
        text_.remove_prefix(4);
        vectors.emplace_back(std::nullopt);
        continue;
      }
      const auto vector = read_vector();
      if (!vector) return std::nullopt;
      vectors.emplace_back(vector);
    }
    return vectors;
  }

 private:
  std::optional<glm::dvec3> read_vector() {
    if (!text_.starts_with('(')) return std::nullopt;
    glm::dvec3 vector(0);
    for (int c = 0; c < 3; ++c) {
      text_.remove_prefix(1);
      const size_t end = text_.find(c < 2 ? ',' : ')');
      if (end == std::string_view::npos) return std::nullopt;
      const auto number = coordinate(trimmed(text_.substr(0, end)));
      if (!number) return std::nullopt;
      vector[c] = *number;
      text_.remove_prefix(end);
    }
    text_.remove_prefix(1);
    return vector;
  }

  std::string_view text_;
};

class NrrdReader {
 public:
  NrrdReader(std::string_view name, std::span<const uint8_t> bytes) : name_(name), lines_(bytes) {}

  Result<NrrdFile> read() {
    VOXELD_TRY(read_lines());
    VOXELD_TRY(read_type());
    VOXELD_TRY(read_encoding());
    VOXELD_TRY(read_sizes());
    VOXELD_TRY(read_kinds());
    VOXELD_TRY(read_place());
    file_.data_begin = lines_.at();
    return file_;
  }

 private:
  Status read_lines();
  Status read_line(std::string_view line);
  Status read_type();
  Status read_encoding();
  Status read_sizes();
  Status read_kinds();
  Status read_place();
  Status read_directions(std::array<glm::dvec3, 3>& directions);
  Status read_spacings(std::array<glm::dvec3, 3>& directions);

  std::string_view field(std::string_view field) const {
    const auto found = fields_.find(field);
    return found == fields_.end() ? std::string_view() : found->second;
  }
  Error broken(std::string_view field, std::string_view what, std::string expected) const {
    const std::string_view text = this->field(field);
    return malformed_volume(name_, spelled(field), what, std::move(expected),
                            text.empty() ? "no such field" : shown_text(text));
  }
  Error unsupported(std::string_view field, std::string_view what, std::string expected) const {
    return unsupported_volume(name_, spelled(field), what, std::move(expected),
                              shown_text(this->field(field)));
  }

  std::string_view name_;
  HeaderLines lines_;
  std::map<std::string_view, std::string_view> fields_;  // by the names of kNrrdRead
  size_t dimension_ = 0;
  NrrdFile file_;
};

Status NrrdReader::read_lines() {
  const auto magic = lines_.next();
  if (!magic) return malformed_volume(name_, "line 1", "the file ends", "NRRD0001 to NRRD0005");
  if (magic->size() != 8 || !magic->starts_with("NRRD000") || (*magic)[7] < '1' ||
      (*magic)[7] > '5') {
    return unsupported_volume(name_, "line 1", "version", "NRRD0001 to NRRD0005",
                              shown_text(*magic));
  }
  while (true) {
    cancel_point();
    const auto line = lines_.next();
    if (!line) {
      return malformed_volume(name_, "header", "the file ends", "an empty line and the samples");
    }
    if (line->empty()) return {};
    if (!line->starts_with('#')) VOXELD_TRY(read_line(*line));
  }
}

Status NrrdReader::read_line(std::string_view line) {
  const std::string place = "line " + std::to_string(lines_.number());
  const size_t key_end = line.find(":="), field_end = line.find(": ");
  if (key_end < field_end) return {};
  const size_t end = std::min(field_end, line.find(':'));
  if (end == std::string_view::npos) {
    return malformed_volume(name_, place, "neither a field nor a key", "\"field: value\"",
                            shown_text(line));
  }
  std::string word = lower_case(line.substr(0, end));
  std::erase(word, ' ');
  if (is_among(word, kNrrdSkipped)) return {};
  const auto* const known = std::ranges::find(kNrrdRead, word);
  if (known == std::end(kNrrdRead)) {
    if (key_end != std::string_view::npos) return {};  // a key with a colon
    return malformed_volume(name_, place, "unknown field", "a field of NRRD",
                            shown_text(line.substr(0, end)));
  }
  const std::string_view value = trimmed(line.substr(end + 1));
  if (*known == "datafile") {
    return unsupported_volume(name_, "data file", "samples in another file",
                              "samples after the header", shown_text(value));
  }
  if (!fields_.emplace(*known, value).second) {
    return malformed_volume(name_, place, "the field is there twice", "",
                            shown_text(line.substr(0, end)));
  }
  return {};
}

Status NrrdReader::read_type() {
  const auto type = nrrd_sample_type(lower_case(field("type")));
  if (!type && field("type") == "block") return unsupported("type", "opaque blocks", "numbers");
  if (!type) return broken("type", "the type of samples", "int8, uint8, ... uint64, float, double");
  file_.array.type = *type;
  if (sample_bytes(*type) == 1) return {};
  const std::string endian = lower_case(field("endian"));
  if (endian != "little" && endian != "big") {
    return broken("endian", "the order of bytes", "little or big");
  }
  file_.array.is_big_endian = endian == "big";
  return {};
}

Status NrrdReader::read_encoding() {
  constexpr std::string_view kOthers[] = {"txt", "text", "ascii", "hex", "bz2", "bzip2", "zrl"};
  const std::string encoding = lower_case(field("encoding"));
  if (is_among(encoding, kOthers)) return unsupported("encoding", "the encoding", "raw or gzip");
  file_.is_gzip = encoding == "gzip" || encoding == "gz";
  if (!file_.is_gzip && encoding != "raw") {
    return broken("encoding", "the encoding", "raw or gzip");
  }
  for (const std::string_view skip : {"lineskip", "byteskip"}) {
    if (!field(skip).empty() && field(skip) != "0") {
      return unsupported(skip, "bytes before the samples", "0");
    }
  }
  return {};
}

Status NrrdReader::read_sizes() {
  const auto dimension = parse_digits<uint32_t>(field("dimension"));
  if (!dimension || *dimension == 0) {
    return broken("dimension", "the number of axes", "a number from 1 on");
  }
  if (*dimension != 3 && *dimension != 4) {
    return unsupported("dimension", "the number of axes", "3, or 4 for colours");
  }
  dimension_ = *dimension;
  std::vector<int64_t> sizes;
  for (const std::string_view word : words_of_line(field("sizes"))) {
    const auto size = parse_digits<int64_t>(word);
    if (!size || *size < 1) return broken("sizes", "cells of an axis", "numbers from 1 on");
    sizes.push_back(*size);
  }
  if (sizes.size() != dimension_) {
    return broken("sizes", "cells of the axes", std::to_string(dimension_) + " numbers");
  }
  if (dimension_ == 4) {
    if (sizes[0] != 3 && sizes[0] != 4) {
      return unsupported("sizes", "the first of four axes", "3 or 4 components of a colour");
    }
    if (file_.array.type != SampleType::kUint8 && file_.array.type != SampleType::kFloat32) {
      return unsupported("type", "the type of colours", "uint8 or float");
    }
    file_.array.components = static_cast<size_t>(sizes[0]);
    sizes.erase(sizes.begin());
  }
  VOXELD_TRY(check_volume_dims(name_, {sizes[0], sizes[1], sizes[2]}));
  std::ranges::transform(sizes, file_.array.order.sides.begin(),
                         [](int64_t size) { return static_cast<uint32_t>(size); });
  return {};
}

// Checks that three axes are of cells, and that the first of four is a colour's. A list or a vector
// of no closer kind is taken as one.
Status NrrdReader::read_kinds() {
  constexpr std::string_view kAny[] = {"???", "none", "list", "vector"};
  if (field("kinds").empty()) return {};
  const auto kinds = words_of_line(field("kinds"));
  if (kinds.size() != dimension_) {
    return broken("kinds", "kinds of the axes", std::to_string(dimension_) + " words");
  }
  if (dimension_ == 3) {
    // Only kinds of components, as RGB-color and 3-vector, have a hyphen.
    const auto has_components = [](std::string_view word) {
      return word.find('-') != std::string_view::npos;
    };
    if (std::ranges::none_of(kinds, has_components)) return {};
    return unsupported("kinds", "components of an image of two axes", "three axes beside them");
  }
  const std::string kind = lower_case(kinds[0]);
  const bool is_three = kind == "rgb-color" || kind == "3-color";
  const bool is_four = kind == "rgba-color" || kind == "4-color";
  if (!is_three && !is_four && !is_among(kind, kAny)) {
    return unsupported("kinds", "the first of four axes", "RGB-color or RGBA-color");
  }
  const size_t components = file_.array.components;
  if ((is_three && components != 3) || (is_four && components != 4)) {
    return broken("kinds", "the first axis has another size",
                  components == 3 ? "RGB-color" : "RGBA-color");
  }
  return {};
}

Status NrrdReader::read_directions(std::array<glm::dvec3, 3>& directions) {
  const auto vectors = NrrdVectors(field("spacedirections")).read();
  const size_t first = dimension_ - 3;  // the axis of components has none
  bool is_valid = vectors && vectors->size() == dimension_;
  for (size_t i = first; is_valid && i < dimension_; ++i) is_valid = (*vectors)[i].has_value();
  if (!is_valid) {
    return broken("spacedirections", "directions of the axes",
                  dimension_ == 3 ? "3 vectors of 3 numbers" : "none and 3 vectors of 3 numbers");
  }
  for (size_t i = 0; i < 3; ++i) directions[i] = *(*vectors)[first + i];
  return {};
}

Status NrrdReader::read_spacings(std::array<glm::dvec3, 3>& directions) {
  const auto words = words_of_line(field("spacings"));
  if (words.size() != dimension_) {
    return broken("spacings", "edges of a voxel", std::to_string(dimension_) + " numbers");
  }
  for (size_t i = 0; i < 3; ++i) {
    const std::string_view word = words[dimension_ - 3 + i];
    if (lower_case(word) == "nan") continue;  // unknown
    const auto number = coordinate(word);
    if (!number) return broken("spacings", "edges of a voxel", "numbers of at most 1e30");
    directions[i][static_cast<int>(i)] = *number;
  }
  return {};
}

// Sets the axes and the grid's place.
Status NrrdReader::read_place() {
  std::array<glm::dvec3, 3> directions = {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0),
                                          glm::dvec3(0, 0, 1)};
  const bool has_directions = !field("spacedirections").empty();
  const std::string_view source = has_directions ? "spacedirections" : "spacings";
  if (has_directions) {
    VOXELD_TRY(read_directions(directions));
  } else if (!field(source).empty()) {
    VOXELD_TRY(read_spacings(directions));
  }
  std::optional<glm::dvec3> origin;
  if (!field("spaceorigin").empty()) {
    const auto vectors = NrrdVectors(field("spaceorigin")).read();
    if (!vectors || vectors->size() != 1 || !vectors->front()) {
      return broken("spaceorigin", "the place of the first sample", "a vector of 3 numbers");
    }
    origin = vectors->front();
  }
  std::array<bool, 3> is_taken{};
  for (size_t i = 0; i < 3; ++i) {
    const glm::dvec3 lengths = glm::abs(directions[i]);
    const int axis = lengths.x >= lengths.y && lengths.x >= lengths.z ? 0
                     : lengths.y >= lengths.z                         ? 1
                                                                      : 2;
    const double size = lengths[axis];
    if (size < kVoxelSizeMin) return broken(source, "a voxel without an edge", "edges above 1e-30");
    const double beside = std::max(lengths[(axis + 1) % 3], lengths[(axis + 2) % 3]);
    if (beside > kDirectionRounding * size || is_taken[static_cast<size_t>(axis)]) {
      return unsupported(source, "axes that are rotated", "one axis of the world for each");
    }
    is_taken[static_cast<size_t>(axis)] = true;
    file_.array.order.axes[i] = static_cast<size_t>(axis);
    file_.array.is_mirrored[i] = directions[i][axis] < 0;
    const uint32_t cells = file_.array.order.sides[i];
    file_.spec.dims[axis] = static_cast<int>(cells);
    file_.spec.voxel_size[axis] = size;
    if (!origin) continue;
    const double before = file_.array.is_mirrored[i] ? cells - 0.5 : 0.5;
    file_.spec.origin_world[axis] = (*origin)[axis] - before * size;
  }
  return {};
}

}  // namespace

Result<NrrdFile> read_nrrd_fields(std::string_view name, std::span<const uint8_t> bytes) {
  return NrrdReader(name, bytes).read();
}

}  // namespace voxeld::volumes
