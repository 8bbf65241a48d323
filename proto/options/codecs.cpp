#include "proto/options/codecs.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "proto/channels.h"
#include "proto/limits.h"
#include "proto/minecraft_blocks.h"
#include "proto/options/morphology_limits.h"
#include "proto/options/words.h"
#include "proto/palette.h"
#include "proto/text/hex.h"
#include "proto/text/number_text.h"
#include "proto/text/text_file.h"

namespace voxeld::option_codecs {
namespace {

using namespace option_values;

// How many colours a .vox may choose from those of a grid.
constexpr int kPaletteCountMin = 1, kPaletteCountMax = 255;

template <size_t N>
OptionText joined(const std::optional<std::array<int, N>>& cells) {
  if (!cells) return {};
  std::string text;
  for (const int cell : *cells) text += (text.empty() ? "" : ",") + std::to_string(cell);
  return text;
}

OptionText text_if_any(const std::string& text) {
  return text.empty() ? OptionText() : OptionText(text);
}

Result<std::array<int, 3>> read_dims(std::string_view name, std::string_view text) {
  const auto parts = split(text);
  const std::string expected =
      "three integers from 1 to " + std::to_string(limits::kGridSideMax) + ", as in 64,128,32";
  if (parts.size() != 3) return invalid(name, expected, text);
  std::array<int, 3> dims{};
  for (size_t i = 0; i < 3; ++i) {
    const auto value = parse_number<int>(parts[i], 1, limits::kGridSideMax);
    if (!value) return invalid(name, expected, text);
    dims[i] = *value;
  }
  return dims;
}

Result<std::array<double, 3>> read_voxel_size(std::string_view name, std::string_view text) {
  const auto parts = split(text);
  const std::string_view expected = "one positive number, or three as in 0.1,0.1,0.2";
  if (parts.size() != 1 && parts.size() != 3) return invalid(name, expected, text);
  std::array<double, 3> size{};
  for (size_t i = 0; i < 3; ++i) {
    const auto value = parse_double(parts[parts.size() == 1 ? 0 : i]);
    if (!value || *value <= 0) return invalid(name, expected, text);
    size[i] = *value;
  }
  return size;
}

Result<std::array<double, 6>> read_bounds(std::string_view name, std::string_view text) {
  VOXELD_ASSIGN(const auto box, option_values::numbers<6>(name, text));
  for (size_t i = 0; i < 3; ++i) {
    if (!(box[i] < box[i + 3])) {
      return invalid(name, "x0,y0,z0,x1,y1,z1 with each minimum below its maximum", text);
    }
  }
  return box;
}

// A column-major matrix would lose its translation without a word.
Result<std::array<double, 16>> read_transform(std::string_view name, std::string_view text) {
  VOXELD_ASSIGN(const auto rows, option_values::numbers<16>(name, text));
  if (std::ranges::equal(std::span(rows).last<4>(), std::array{0.0, 0.0, 0.0, 1.0})) return rows;
  return invalid(name, "16 numbers, row-major: the last four are 0,0,0,1", text);
}

// "a list of occupancy, color, … and coverage"
std::string channels_expected() {
  std::string names = "a list of occupancy";
  for (const ChannelInfo& info : kChannels) {
    names += (&info == &kChannels.back() ? " and " : ", ") + std::string(info.name);
  }
  return names;
}

Result<ChannelSet> read_channels(std::string_view name, std::string_view text) {
  ChannelSet channels;
  for (const std::string_view part : split(text)) {
    const auto info = std::ranges::find(kChannels, part, &ChannelInfo::name);
    if (info != kChannels.end()) {
      channels.set(info->channel);
    } else if (part != "occupancy") {
      return invalid(name, channels_expected(), text);
    }
  }
  return channels;
}

std::string names_of(const ChannelSet& channels) {
  std::string names = "occupancy";
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) names += "," + std::string(info.name);
  }
  return names;
}

OptionText write_channels(const std::optional<ChannelSet>& channels) {
  return text_if_set(channels, names_of);
}

Result<std::optional<Channel>> read_one_channel(std::string_view name, std::string_view text) {
  if (text == "occupancy") return std::optional<Channel>();
  const auto info = std::ranges::find(kChannels, text, &ChannelInfo::name);
  if (info != kChannels.end()) return std::optional(info->channel);
  std::string expected = "occupancy";
  for (const ChannelInfo& known : kChannels) expected += " | " + std::string(known.name);
  return invalid(name, expected, text);
}

// Canonical JSON holds the animation's name, and JSON must be UTF-8.
static_assert(client_texts::kAnimation.bytes_max == client_texts::kVariant.bytes_max);
Result<std::string> read_name_or_number(std::string_view name, std::string_view text) {
  if (text.empty() || text.size() > client_texts::kAnimation.bytes_max ||
      text.find('\0') != std::string_view::npos || !is_utf8(text)) {
    return invalid(name, "a name or number: 1 to 255 bytes of UTF-8 without NUL", text);
  }
  return std::string(text);
}

Result<std::array<int, 2>> read_frames(std::string_view name, std::string_view text) {
  const size_t dots = text.find("..");
  const auto first = parse_int(text.substr(0, dots));
  const auto last = dots == std::string_view::npos ? first : parse_int(text.substr(dots + 2));
  if (!first || !last || *first < 0 || *last < *first) {
    return invalid(
        name, "FIRST..LAST, or one number: integers from 0 on, the first not above the last", text);
  }
  if (*last - *first >= limits::kFramesMax) {
    return invalid(name, "at most " + std::to_string(limits::kFramesMax) + " of them", text);
  }
  return std::array<int, 2>{*first, *last};
}

OptionText write_frames(const std::optional<std::array<int, 2>>& frames) {
  if (!frames) return {};
  return std::to_string((*frames)[0]) + ".." + std::to_string((*frames)[1]);
}

Result<std::vector<double>> read_times(std::string_view name, std::string_view text) {
  const auto parts = split(text);
  if (parts.size() > static_cast<size_t>(limits::kFramesMax)) {
    return invalid(name, "at most " + std::to_string(limits::kFramesMax) + " times",
                   std::to_string(parts.size()));
  }
  std::vector<double> times_s;
  for (const std::string_view part : parts) {
    const auto value = parse_double(part);
    const bool ascends = times_s.empty() || (value && *value > times_s.back());
    if (!value || *value < 0 || *value > limits::kAnimationSecondsMax || !ascends) {
      return invalid(name,
                     "T0,T1,…: seconds from 0 to " + to_text(limits::kAnimationSecondsMax) +
                         ", each above the one before it",
                     text);
    }
    times_s.push_back(*value);
  }
  return times_s;
}

std::span<const Word<Format>> format_words() {
  static const std::vector<Word<Format>> words = [] {
    std::vector<Word<Format>> all;
    for (const FormatInfo& info : output_formats()) all.push_back({info.name, info.format});
    return all;
  }();
  return words;
}

Result<std::array<int, 6>> read_region(std::string_view name, std::string_view text) {
  const auto parts = split(text);
  const Error wrong =
      invalid(name,
              "x0,y0,z0,x1,y1,z1: integers from 0 to " + std::to_string(limits::kGridSideMax) +
                  ", each minimum below its maximum",
              text);
  if (parts.size() != 6) return wrong;
  std::array<int, 6> region{};
  for (size_t i = 0; i < region.size(); ++i) {
    const auto value = parse_number<int>(parts[i], 0, limits::kGridSideMax);
    if (!value) return wrong;
    region[i] = *value;
  }
  for (size_t i = 0; i < 3; ++i) {
    if (region[i] >= region[i + 3]) return wrong;
  }
  return region;
}

using Color = std::array<uint8_t, 4>;

// Reads pairs of hexadecimal digits, with or without a number sign before them, into the first
// components. Returns whether there are `digits` of them and nothing else.
template <size_t N>
bool read_hex(std::string_view text, size_t digits, std::array<uint8_t, N>& components) {
  if (text.starts_with('#')) text.remove_prefix(1);
  if (text.size() != digits) return false;
  for (size_t i = 0; i < digits / 2; ++i) {
    const char* begin = text.data() + 2 * i;
    const auto [end, error] = std::from_chars(begin, begin + 2, components[i], 16);
    if (error != std::errc() || end != begin + 2) return false;
  }
  return true;
}

Result<Color> read_color(std::string_view name, std::string_view text) {
  if (text == "transparent") return Color{0, 0, 0, 0};
  Color color = {0, 0, 0, 255};
  if (read_hex(text, 6, color) || read_hex(text, 8, color)) return color;
  return invalid(name, "#rrggbb | #rrggbbaa | transparent", text);
}

std::string palette_names() {
  std::string names;
  for (const NamedPalette& palette : named_palettes()) {
    names += (names.empty() ? "" : " | ") + std::string(palette.name);
  }
  return names;
}

// Colours as in "#1a1c2c,#f4f4f4".
Result<std::vector<PaletteColor>> read_palette_colors(std::string_view name,
                                                      std::string_view text) {
  const std::vector<std::string_view> parts = split(text);
  if (parts.size() > kPaletteColorsMax) {
    return invalid(name, "at most " + std::to_string(kPaletteColorsMax) + " colours",
                   std::to_string(parts.size()));
  }
  std::vector<PaletteColor> colors(parts.size());
  for (size_t i = 0; i < parts.size(); ++i) {
    if (read_hex(parts[i], 6, colors[i])) continue;
    if (parts.size() == 1) {
      return invalid(name,
                     std::to_string(kPaletteCountMin) + " to " + std::to_string(kPaletteCountMax) +
                         ", colours as in #1a1c2c,#f4f4f4, or " + palette_names(),
                     text);
    }
    return invalid(std::string(name) + ", colour " + std::to_string(i + 1), "#rrggbb", parts[i]);
  }
  return without_repeats(colors);
}

Status parse_palette(RequestOptions& options, std::string_view name, std::string_view text) {
  OutputOptions& output = options.output;
  const auto count = parse_number<int>(text, kPaletteCountMin, kPaletteCountMax);
  if (count && text.size() <= 3) {  // six digits are a colour
    output.palette_max = *count;
    output.palette.clear();
    return {};
  }
  if (const NamedPalette* known = find_palette(text)) {
    output.palette = known->colors;
    return {};
  }
  VOXELD_ASSIGN(output.palette, read_palette_colors(name, text));
  return {};
}

constexpr std::string_view kAxisNames = "xyz";

using Axes = std::array<bool, 3>;

Result<Axes> read_axes(std::string_view name, std::string_view text) {
  Axes axes{};
  for (const std::string_view part : split(text)) {
    const size_t axis = part.size() == 1 ? kAxisNames.find(part) : std::string_view::npos;
    if (axis == std::string_view::npos) return invalid(name, "a list of x, y and z", text);
    axes[axis] = true;
  }
  return axes;
}

OptionText write_axes(const Axes& axes) {
  std::string text;
  for (size_t c = 0; c < axes.size(); ++c) {
    if (!axes[c]) continue;
    if (!text.empty()) text += ',';
    text += kAxisNames[c];
  }
  return text_if_any(text);
}

Result<int> read_keep(std::string_view name, std::string_view text) {
  if (text == "largest") return 1;
  const auto count = parse_number<int>(text, 0, limits::kComponentsMax);
  if (count) return *count;
  return invalid(name, "largest, or 0 (all) to " + std::to_string(limits::kComponentsMax), text);
}

Result<std::vector<LabelChange>> read_remap(std::string_view name, std::string_view text) {
  constexpr int kLabelMax = 65535;
  std::vector<LabelChange> changes;
  for (const std::string_view part : split(text)) {
    const size_t colon = std::min(part.find(':'), part.size());
    const auto from = parse_number<int>(part.substr(0, colon), 1, kLabelMax);
    const auto to =
        colon < part.size() ? parse_number<int>(part.substr(colon + 1), 1, kLabelMax) : from;
    if (!from || !to || colon == part.size()) {
      return invalid(name, "FROM:TO,... of labels from 1 to 65535", text);
    }
    changes.push_back({static_cast<uint16_t>(*from), static_cast<uint16_t>(*to)});
  }
  if (changes.size() > static_cast<size_t>(limits::kLabelChangesMax)) {
    return invalid(name, "at most " + std::to_string(limits::kLabelChangesMax) + " changes",
                   std::to_string(changes.size()));
  }
  std::ranges::sort(changes, {}, &LabelChange::from);
  const auto same = std::ranges::adjacent_find(changes, {}, &LabelChange::from);
  if (same == changes.end()) return changes;
  return invalid(name, "each label once before a colon",
                 std::to_string(same->from) + " more than once");
}

OptionText write_remap(const std::vector<LabelChange>& changes) {
  std::string text;
  for (const LabelChange& change : changes) {
    if (!text.empty()) text += ',';
    text += std::to_string(change.from) + ":" + std::to_string(change.to);
  }
  return text_if_any(text);
}

Result<int> read_samples(std::string_view name, std::string_view text) {
  if (text == "auto") return 0;
  const auto value = parse_number<int>(text, 1, limits::kSamplesPerSideMax);
  if (value) return *value;
  return invalid(name, "auto, or 1 to " + std::to_string(limits::kSamplesPerSideMax), text);
}

Result<std::array<double, 4>> read_plane(std::string_view name, std::string_view text) {
  VOXELD_ASSIGN(const auto plane, option_values::numbers<4>(name, text));
  if (plane[0] == 0 && plane[1] == 0 && plane[2] == 0) {
    return invalid(name, "a,b,c,d with a normal a,b,c other than 0", text);
  }
  return plane;
}

Result<std::string> read_filename(std::string_view, std::string_view text) {
  VOXELD_TRY(check_filename(text));
  return std::string(text);
}

}  // namespace

std::string channel_names() {
  ChannelSet all;
  for (const ChannelInfo& info : kChannels) all.set(info.channel);
  return names_of(all);
}

OptionCodec dims() {
  return member_codec(&PlacementOptions::dims,
                      NumberListValues{.count_min = 3,
                                       .count_max = 3,
                                       .is_integer = true,
                                       .min = 1,
                                       .max = limits::kGridSideMax},
                      read_dims, joined<3>);
}

OptionCodec voxel_size() {
  return numbers(
      &PlacementOptions::voxel_size, read_voxel_size,
      {.count_min = 3, .count_max = 3, .min = 0, .excludes_min = true, .takes_one = true});
}

OptionCodec bounds() {
  return numbers(&PlacementOptions::bounds, read_bounds);
}

OptionCodec transform() {
  return numbers(&PlacementOptions::transform, read_transform);
}

OptionCodec units() {
  static constexpr std::array<Word<std::string_view>, 5> kUnits = {
      {{"m", "m"}, {"cm", "cm"}, {"mm", "mm"}, {"in", "in"}, {"ft", "ft"}}};
  WordValues values;
  for (const auto& unit : kUnits) values.words.push_back(unit.text);
  return member_codec(
      &PlacementOptions::units, std::move(values),
      [](std::string_view name, std::string_view text) {
        return one_of<std::string_view>(name, text, kUnits);
      },
      text_if_any);
}

OptionCodec channels() {
  WordListValues values{{"occupancy"}};
  for (const ChannelInfo& info : kChannels) values.words.push_back(info.name);
  return member_codec(&VoxelizeOptions::channels, std::move(values), read_channels, write_channels);
}

OptionCodec one_channel() {
  WordValues values{{"occupancy"}};
  for (const ChannelInfo& info : kChannels) values.words.push_back(info.name);
  return member_codec(&OutputOptions::channel, std::move(values), read_one_channel,
                      [](const std::optional<Channel>& channel) {
                        return text_if_set(channel, [](Channel set) {
                          return std::string(channel_info(set).name);
                        });
                      });
}

template <typename Part>
OptionCodec name_or_number(std::optional<std::string> Part::*member) {
  return member_codec(
      member, TextValues{"^[^\\u0000]+$", /*takes_integer=*/true}, read_name_or_number,
      [](const std::optional<std::string>& name) { return text_if_any(name.value_or("")); });
}

OptionCodec animation_name() {
  return name_or_number(&AnimationOptions::animation);
}

OptionCodec variant_name() {
  return name_or_number(&VoxelizeOptions::variant);
}

OptionCodec frames() {
  return member_codec(&AnimationOptions::frames,
                      TextValues{R"(^[0-9]+(\.\.[0-9]+)?$)", /*takes_integer=*/true}, read_frames,
                      write_frames);
}

OptionCodec times() {
  return member_codec(
      &AnimationOptions::times_s,
      NumberListValues{
          .count_max = limits::kFramesMax, .min = 0, .max = limits::kAnimationSecondsMax},
      read_times, [](const std::vector<double>& times_s) { return text_if_any(to_text(times_s)); });
}

OptionCodec format() {
  return word(&OutputOptions::format, format_words());
}

OptionCodec region() {
  return member_codec(&OutputOptions::region,
                      NumberListValues{.count_min = 6,
                                       .count_max = 6,
                                       .is_integer = true,
                                       .min = 0,
                                       .max = limits::kGridSideMax},
                      read_region, joined<6>);
}

OptionCodec blocks() {
  WordListValues values{{}, "[a-z0-9_:]+"};
  const auto groups = minecraft_block_groups();
  values.words.assign(groups.begin(), groups.end());
  return member_codec(
      &OutputOptions::blocks, std::move(values),
      [](std::string_view name, std::string_view text) {
        return canonical_block_names(name, split(text));
      },
      [](const std::vector<std::string>& names) {
        std::string text;
        for (const std::string& one : names) text += (text.empty() ? "" : ",") + one;
        return text_if_any(text);
      });
}

// Canonical JSON has the colours of a name.
OptionCodec palette() {
  return {TextValues{"^([0-9]{1,3}|[a-z][a-z0-9]*|#?[0-9A-Fa-f]{6}(,#?[0-9A-Fa-f]{6})*)$",
                     /*takes_integer=*/true},
          parse_palette, [](const RequestOptions& options) -> OptionText {
            const OutputOptions& output = options.output;
            if (output.palette.empty()) return output.palette_max;
            return palette_text(output.palette);
          }};
}

OptionCodec keep() {
  return member_codec(&OutputOptions::keep,
                      TextValues{"^(largest|0|[1-9][0-9]{0,6})$", /*takes_integer=*/true},
                      read_keep, [](int count) -> OptionText {
                        return count == 0 ? OptionText() : OptionText(std::to_string(count));
                      });
}

OptionCodec remap() {
  return member_codec(&OutputOptions::remap,
                      TextValues{"^[0-9]{1,5}:[0-9]{1,5}(,[0-9]{1,5}:[0-9]{1,5})*$"}, read_remap,
                      write_remap);
}

OptionCodec mirror() {
  return member_codec(&OutputOptions::mirror, WordListValues{{"x", "y", "z"}}, read_axes,
                      write_axes);
}

OptionCodec background() {
  return member_codec(
      &RenderOptions::background, TextValues{"^(transparent|#?([0-9A-Fa-f]{6}|[0-9A-Fa-f]{8}))$"},
      read_color, [](const std::optional<Color>& color) {
        return text_if_set(color, [](const Color& set) { return "#" + hex_text(set); });
      });
}

OptionCodec samples() {
  static const std::vector<std::string> counts = [] {
    std::vector<std::string> all;
    for (int i = 1; i <= limits::kSamplesPerSideMax; ++i) all.push_back(std::to_string(i));
    return all;
  }();
  WordValues values{{"auto"}};
  values.words.insert(values.words.end(), counts.begin(), counts.end());
  return member_codec(
      &RenderOptions::samples, std::move(values), read_samples,
      [](int samples) -> OptionText { return samples == 0 ? "auto" : std::to_string(samples); });
}

OptionCodec section() {
  return numbers(&RenderOptions::section, read_plane);
}

OptionCodec filename() {
  return member_codec(&RequestOptions::filename, TextValues{"^[^\\u0000]*$"}, read_filename,
                      text_if_any);
}

}  // namespace voxeld::option_codecs
