#include "proto/options/codecs.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "proto/channels.h"
#include "proto/hex.h"
#include "proto/limits.h"
#include "proto/number_text.h"
#include "proto/options/words.h"

namespace voxeld::option_codecs {
namespace {

using namespace option_values;

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

// Canonical JSON holds the animation's name, and JSON must be UTF-8.
bool is_utf8(std::string_view text) {
  using Handler = nlohmann::json::error_handler_t;
  const nlohmann::json json(text);
  return json.dump(-1, ' ', false, Handler::replace) == json.dump(-1, ' ', false, Handler::ignore);
}

Result<std::string> read_animation(std::string_view name, std::string_view text) {
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

Result<Color> read_color(std::string_view name, std::string_view text) {
  if (text == "transparent") return Color{0, 0, 0, 0};
  const std::string_view digits = text.starts_with('#') ? text.substr(1) : text;
  const Error wrong = invalid(name, "#rrggbb | #rrggbbaa | transparent", text);
  if (digits.size() != 6 && digits.size() != 8) return wrong;
  Color color = {0, 0, 0, 255};
  for (size_t i = 0; i < digits.size() / 2; ++i) {
    const char* begin = digits.data() + 2 * i;
    const auto [end, error] = std::from_chars(begin, begin + 2, color[i], 16);
    if (error != std::errc() || end != begin + 2) return wrong;
  }
  return color;
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

OptionCodec animation_name() {
  return member_codec(
      &AnimationOptions::animation, TextValues{"^[^\\u0000]+$", /*takes_integer=*/true},
      read_animation,
      [](const std::optional<std::string>& name) { return text_if_any(name.value_or("")); });
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
