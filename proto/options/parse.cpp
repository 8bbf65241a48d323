#include "proto/options/options.h"

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <set>

#include "proto/client_texts.h"
#include "proto/limits.h"
#include "proto/options/rules.h"
#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld {
namespace {

using namespace option_values;
namespace words = option_words;

// The highest level of detail: 2^14 cells are the longest side of a grid.
constexpr int kLevelMax = std::countr_zero(unsigned{limits::kGridSideMax});

template <typename Enum, size_t N>
Status set_word(Enum& field, std::string_view name, std::string_view text,
                const std::array<Word<Enum>, N>& list) {
  VOXELD_ASSIGN(field, (one_of<Enum>(name, text, list)));
  return {};
}

Status set_int(int& field, std::string_view name, std::string_view text, int min, int max) {
  VOXELD_ASSIGN(field, int_between(name, text, min, max));
  return {};
}

Status set_format(Format& field, std::string_view text) {
  const auto format = format_from_name(text);
  if (!format) return invalid("format", format_names(" | "), text);
  field = *format;
  return {};
}

template <size_t N>
Status set_numbers(std::optional<std::array<double, N>>& field, std::string_view name,
                   std::string_view text) {
  VOXELD_ASSIGN(field, numbers<N>(name, text));
  return {};
}

Status set_dims(PlacementOptions& placement, std::string_view text) {
  const auto parts = split(text);
  const std::string expected =
      "three integers from 1 to " + std::to_string(limits::kGridSideMax) + ", as in 64,128,32";
  if (parts.size() != 3) return invalid("dims", expected, text);
  std::array<int, 3> dims{};
  for (size_t i = 0; i < 3; ++i) {
    const auto value = parse_int(parts[i]);
    if (!value || *value < 1 || *value > limits::kGridSideMax) {
      return invalid("dims", expected, text);
    }
    dims[i] = *value;
  }
  placement.dims = dims;
  return {};
}

Status set_voxel_size(PlacementOptions& placement, std::string_view text) {
  const auto parts = split(text);
  const std::string_view expected = "one positive number, or three as in 0.1,0.1,0.2";
  if (parts.size() != 1 && parts.size() != 3) return invalid("voxel_size", expected, text);
  std::array<double, 3> size{};
  for (size_t i = 0; i < 3; ++i) {
    const auto value = parse_double(parts[parts.size() == 1 ? 0 : i]);
    if (!value || *value <= 0) return invalid("voxel_size", expected, text);
    size[i] = *value;
  }
  placement.voxel_size = size;
  return {};
}

Status set_bounds(PlacementOptions& placement, std::string_view text) {
  VOXELD_ASSIGN(const auto box, numbers<6>("bounds", text));
  for (size_t i = 0; i < 3; ++i) {
    if (!(box[i] < box[i + 3])) {
      return invalid("bounds", "x0,y0,z0,x1,y1,z1 with each minimum below its maximum", text);
    }
  }
  placement.bounds = box;
  return {};
}

Status set_channels(VoxelizeOptions& voxelize, std::string_view text) {
  voxelize.channels_given = true;
  for (const std::string_view part : split(text)) {
    if (part == "color") {
      voxelize.channel_color = true;
    } else if (part == "normal") {
      voxelize.channel_normal = true;
    } else if (part == "material") {
      voxelize.channel_material = true;
    } else if (part == "label") {
      voxelize.channel_label = true;
    } else if (part == "distance") {
      voxelize.channel_distance = true;
    } else if (part == "coverage") {
      voxelize.channel_coverage = true;
    } else if (part != "occupancy") {
      return invalid("channels",
                     "a list of occupancy, color, normal, material, label, distance and coverage",
                     text);
    }
  }
  return {};
}

Status set_units(PlacementOptions& placement, std::string_view text) {
  for (const std::string_view unit : {"m", "cm", "mm", "in", "ft"}) {
    if (text == unit) {
      placement.units = text;
      return {};
    }
  }
  return invalid("units", "m | cm | mm | in | ft", text);
}

Status set_samples(RenderOptions& render, std::string_view text) {
  if (text == "auto") {
    render.samples = 0;
    return {};
  }
  const auto value = parse_int(text);
  if (!value || *value < 1 || *value > limits::kSamplesPerSideMax) {
    return invalid("samples", "auto, or 1 to " + std::to_string(limits::kSamplesPerSideMax), text);
  }
  render.samples = *value;
  return {};
}

Status set_background(RenderOptions& render, std::string_view text) {
  if (text == "transparent") {
    render.background = {0, 0, 0, 0};
    return {};
  }
  const std::string_view digits = text.starts_with('#') ? text.substr(1) : text;
  const Error wrong = invalid("background", "#rrggbb | #rrggbbaa | transparent", text);
  if (digits.size() != 6 && digits.size() != 8) return wrong;
  render.background = {0, 0, 0, 255};
  for (size_t i = 0; i < digits.size() / 2; ++i) {
    const char* begin = digits.data() + 2 * i;
    const auto [end, error] = std::from_chars(begin, begin + 2, render.background[i], 16);
    if (error != std::errc() || end != begin + 2) return wrong;
  }
  return {};
}

Status set_section(RenderOptions& render, std::string_view text) {
  VOXELD_ASSIGN(const auto plane, numbers<4>("section", text));
  if (plane[0] == 0 && plane[1] == 0 && plane[2] == 0) {
    return invalid("section", "a,b,c,d with a normal a,b,c other than 0", text);
  }
  render.section = plane;
  return {};
}

Status set_placement(PlacementOptions& p, std::string_view name, std::string_view text) {
  if (name == "size") {
    VOXELD_ASSIGN(p.size, int_between(name, text, 1, limits::kGridSideMax));
    return {};
  }
  if (name == "dims") return set_dims(p, text);
  if (name == "voxel_size") return set_voxel_size(p, text);
  if (name == "padding") return set_int(p.padding, name, text, 0, limits::kPaddingMax);
  if (name == "bounds") return set_bounds(p, text);
  if (name == "up") return set_word(p.up, name, text, words::kUp);
  if (name == "units") return set_units(p, text);
  return set_numbers(p.transform, name, text);
}

Status set_number(double& field, std::string_view name, std::string_view text, double min,
                  double max) {
  VOXELD_ASSIGN(field, number_between(name, text, min, max));
  return {};
}

Status set_voxelize(VoxelizeOptions& v, std::string_view name, std::string_view text) {
  if (name == "rule") return set_word(v.rule, name, text, words::kRule);
  if (name == "fill") return set_word(v.fill, name, text, words::kFill);
  if (name == "sign") return set_word(v.sign, name, text, words::kSign);
  if (name == "thickness") {
    return set_number(v.thickness, name, text, 1, limits::kShellThicknessMax);
  }
  if (name == "interior") return set_word(v.interior, name, text, words::kInterior);
  if (name == "color") return set_word(v.color, name, text, words::kColor);
  if (name == "channels") return set_channels(v, text);
  if (name == "labels") return set_word(v.labels, name, text, words::kLabels);
  if (name == "pipeline") return set_word(v.pipeline, name, text, words::kPipeline);
  return set_placement(v.placement, name, text);
}

Status set_region(OutputOptions& output, std::string_view text) {
  const auto parts = split(text);
  const std::string expected = "x0,y0,z0,x1,y1,z1: integers from 0 to " +
                               std::to_string(limits::kGridSideMax) +
                               ", each minimum below its maximum";
  if (parts.size() != 6) return invalid("region", expected, text);
  std::array<int, 6> region{};
  for (size_t i = 0; i < region.size(); ++i) {
    const auto value = parse_int(parts[i]);
    if (!value || *value < 0 || *value > limits::kGridSideMax) {
      return invalid("region", expected, text);
    }
    region[i] = *value;
  }
  for (size_t i = 0; i < 3; ++i) {
    if (region[i] >= region[i + 3]) return invalid("region", expected, text);
  }
  output.region = region;
  return {};
}

Status set_output(OutputOptions& o, std::string_view name, std::string_view text) {
  if (name == "format") return set_format(o.format, text);
  if (name == "codec") return set_word(o.codec, name, text, words::kCodec);
  if (name == "axes") return set_word(o.axes, name, text, words::kAxes);
  if (name == "dtype") return set_word(o.dtype, name, text, words::kDType);
  if (name == "level") return set_int(o.level, name, text, 0, kLevelMax);
  if (name == "level_rule") return set_word(o.level_rule, name, text, words::kLevelRule);
  if (name == "region") return set_region(o, text);
  return set_int(o.palette_max, name, text, 1, 255);
}

Status set_render(RenderOptions& r, std::string_view name, std::string_view text) {
  if (name == "width") return set_int(r.width, name, text, 1, limits::kRenderSideMax);
  if (name == "height") return set_int(r.height, name, text, 1, limits::kRenderSideMax);
  if (name == "projection") return set_word(r.projection, name, text, words::kProjection);
  if (name == "azimuth") return set_number(r.azimuth_deg, name, text, -3600, 3600);
  if (name == "elevation") return set_number(r.elevation_deg, name, text, -90, 90);
  if (name == "zoom") return set_number(r.zoom, name, text, 0.01, 1000);
  if (name == "matrix") return set_numbers(r.matrix, name, text);
  if (name == "background") return set_background(r, text);
  if (name == "light") return set_word(r.light, name, text, words::kLight);
  if (name == "occlusion") return set_word(r.occlusion, name, text, words::kYesNo);
  if (name == "shadow") return set_word(r.shadow, name, text, words::kYesNo);
  if (name == "samples") return set_samples(r, text);
  if (name == "renderer") return set_word(r.renderer, name, text, words::kRenderer);
  return set_section(r, text);
}

bool in_scope(const OptionInfo& option, OptionScope scope) {
  switch (scope) {
    case OptionScope::kVoxelize:
      return option.for_voxelize || option.for_output;
    case OptionScope::kRenderMesh:
      return option.for_voxelize || option.for_render;
    case OptionScope::kRenderGrid:
      return option.for_render;
    case OptionScope::kExport:
      return option.for_output;
  }
  return false;
}

// Levenshtein distance, for suggestions.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

Error unknown_option(std::string_view name, OptionScope scope) {
  const std::string_view shown = name.substr(0, 40);
  std::vector<std::pair<size_t, std::string_view>> near;
  bool elsewhere = false;
  for (const OptionInfo& option : option_table()) {
    if (in_scope(option, scope)) near.emplace_back(edit_distance(shown, option.name), option.name);
    elsewhere = elsewhere || option.name == name;
  }
  std::ranges::stable_sort(near, {}, [](const auto& entry) { return entry.first; });
  std::string expected = "one of";
  for (size_t i = 0; i < near.size() && i < 3; ++i) {
    expected += (i == 0 ? " " : ", ") + std::string(near[i].second);
  }
  return {ErrorCode::kUnknownOption,
          elsewhere ? "option does not apply to this request" : "no such option", expected + ", …",
          "\"" + std::string(shown) + "\""};
}

Status set_option(RequestOptions& options, const OptionInfo& option, std::string_view text) {
  if (option.name == "cache") {
    return set_word(options.use_cache, option.name, text, words::kYesNo);
  }
  if (option.name == "filename") {
    VOXELD_TRY(check_filename(text));
    options.filename = text;
    return {};
  }
  if (option_rules::is_animation_option(option.name)) {
    return option_rules::set_animation(options.animation, option.name, text);
  }
  if (option_rules::is_picture_option(option.name)) {
    return option_rules::set_picture(options.render, option.name, text);
  }
  if (option.for_voxelize) return set_voxelize(options.voxelize, option.name, text);
  if (option.for_output) return set_output(options.output, option.name, text);
  return set_render(options.render, option.name, text);
}

Status check_option_length(std::string_view name, std::string_view text) {
  using namespace client_texts;
  if (name == kTimes.name) return check_length(kTimes, text);
  if (name == kAnimation.name) return check_length(kAnimation, text);
  if (name == kFilename.name) return check_length(kFilename, text);
  return check_length(kOption, name, text);
}

constexpr double kDefaultBandThickness = 3.0;  // voxels
constexpr int kDefaultSheetSide = 160;         // pixels of one image of a sheet

// Refuses options that would have no effect: they are more likely a mistake.
Status check_fill(const VoxelizeOptions& v, const std::set<std::string_view>& given) {
  const std::string_view fill = word_of<Fill>(v.fill, words::kFill);
  // A band has distances if the request names no channels.
  const bool measures = v.channel_distance || (v.fill == Fill::kBand && !v.channels_given);
  if (given.contains("sign") && !measures && v.fill != Fill::kSolid && v.fill != Fill::kShell) {
    return invalid("sign", "fill solid or shell or channel distance with it", fill);
  }
  if (v.channel_coverage && v.fill != Fill::kSurface && v.fill != Fill::kSolid) {
    return invalid("channels", "fill surface or solid with coverage", fill);
  }
  if (v.channel_coverage && v.fill == Fill::kSolid && v.sign == Sign::kFlood) {
    return invalid("sign", "parity, nonzero, majority, winding or auto with coverage", "flood");
  }
  if (given.contains("thickness") && v.fill != Fill::kShell && v.fill != Fill::kBand) {
    return invalid("thickness", "fill shell or band with it", fill);
  }
  if (given.contains("interior") && v.fill != Fill::kSolid && v.fill != Fill::kShell) {
    return invalid("interior", "fill solid or shell with it", fill);
  }
  if (v.interior == Interior::kNearest && v.rule == Rule::kNone) {
    return invalid("rule", "touch, thin or center where interior is nearest", "none");
  }
  return {};
}

Status check_combinations(const RequestOptions& options) {
  const VoxelizeOptions& v = options.voxelize;
  if (v.rule == Rule::kNone && v.fill == Fill::kSurface) {
    return invalid("rule", "touch, thin or center where fill is surface", "none");
  }
  const PlacementOptions& p = v.placement;
  const int given = (p.size ? 1 : 0) + (p.dims ? 1 : 0) + (p.voxel_size ? 1 : 0);
  if (given > 1) {
    return Error{ErrorCode::kInvalidOption, "size, dims and voxel_size exclude each other",
                 "at most one of them", std::to_string(given)};
  }
  if (p.voxel_size) return {};
  const int side = p.dims ? std::ranges::min(*p.dims) : p.size.value_or(kDefaultSize);
  if (2 * p.padding >= side) {
    return invalid("padding",
                   p.dims ? "less than half of each of dims"
                          : "less than half of size " + std::to_string(side),
                   std::to_string(p.padding));
  }
  return {};
}

// Cuts the text: a client can send anything in place of an option's name.
std::string shown_name(std::string_view name) {
  return std::string(name.substr(0, kEchoBytesMax));
}

Result<std::string> text_of(std::string_view name, const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return std::string(value.get<bool>() ? "yes" : "no");
  if (value.is_number_integer()) return value.dump();
  if (value.is_number()) return to_text(value.get<double>());
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
  std::set<std::string_view> seen;
  for (const auto& [name, text] : pairs) {
    const auto row = std::ranges::find(option_table(), std::string_view(name), &OptionInfo::name);
    if (row == option_table().end() || !in_scope(*row, scope)) return unknown_option(name, scope);
    if (!seen.insert(name).second) {
      return Error{ErrorCode::kInvalidOption, name, "to be given once", "it twice"};
    }
    VOXELD_TRY(check_option_length(name, text));
    VOXELD_TRY(set_option(options, *row, text));
  }
  VOXELD_TRY(check_fill(options.voxelize, seen));
  if (seen.contains("labels") && !options.voxelize.channel_label) {
    return invalid("labels", "channel label with it", "channels without it");
  }
  if (options.voxelize.fill == Fill::kBand && !seen.contains("thickness")) {
    options.voxelize.thickness = kDefaultBandThickness;
  }
  if (options.render.picture == PictureKind::kSheet) {
    if (!seen.contains("width")) options.render.width = kDefaultSheetSide;
    if (!seen.contains("height")) options.render.height = kDefaultSheetSide;
  }
  option_rules::complete_animation(options, scope, seen);
  VOXELD_TRY(option_rules::check_animation(options.animation, seen));
  VOXELD_TRY(option_rules::check_picture(options, scope, seen));
  VOXELD_TRY(check_combinations(options));
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
