// Codecs of options: each binds a member of RequestOptions to the form of its text. The templates
// take a pointer to the member; the functions are for options with a form of their own.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "proto/options/table.h"
#include "proto/options/values.h"

namespace voxeld::option_codecs {

// The struct of a request that has the members of `Part`. `Options` is RequestOptions or const.
template <typename Part, typename Options>
auto& part_of(Options& options) {
  if constexpr (std::is_same_v<Part, PlacementOptions>) {
    return options.voxelize.placement;
  } else if constexpr (std::is_same_v<Part, VoxelizeOptions>) {
    return options.voxelize;
  } else if constexpr (std::is_same_v<Part, AnimationOptions>) {
    return options.animation;
  } else if constexpr (std::is_same_v<Part, OutputOptions>) {
    return options.output;
  } else if constexpr (std::is_same_v<Part, RenderOptions>) {
    return options.render;
  } else {
    static_assert(std::is_same_v<Part, RequestOptions>);
    return options;
  }
}

// Binds a member to read(name, text), a Result of its value, and to write(member), an OptionText.
template <typename Part, typename T, typename Read, typename Write>
OptionCodec member_codec(T Part::*member, OptionValues values, Read read, Write write) {
  return {std::move(values),
          [=](RequestOptions& options, std::string_view name, std::string_view text) -> Status {
            VOXELD_ASSIGN(part_of<Part>(options).*member, read(name, text));
            return {};
          },
          [=](const RequestOptions& options) -> OptionText {
            return write(part_of<Part>(options).*member);
          }};
}

// The text of a member that may be unset.
template <typename T, typename Write>
OptionText text_if_set(const std::optional<T>& value, Write write) {
  return value ? OptionText(write(*value)) : OptionText();
}

// An integer in [min, max]; a member outside of the range is unset. Canonical JSON has `unset` for
// such a one; without `unset` it omits the option.
template <typename Part, typename T>
OptionCodec integer(T Part::*member, int min, int max, std::optional<int> unset = {}) {
  return member_codec(
      member, IntegerValues{min, max},
      [=](std::string_view name, std::string_view text) {
        return option_values::int_between(name, text, min, max);
      },
      [=](const std::optional<int>& value) -> OptionText {
        const auto known = value && *value >= min && *value <= max ? value : unset;
        return known ? OptionText(*known) : OptionText();
      });
}

// A finite number in [min, max].
template <typename Part, typename T>
OptionCodec number(T Part::*member, double min, double max) {
  return member_codec(
      member, NumberValues{min, max},
      [=](std::string_view name, std::string_view text) {
        return option_values::number_between(name, text, min, max);
      },
      [](const std::optional<double>& value) {
        return text_if_set(value, [](double set) { return option_values::to_text(set); });
      });
}

// A word of `list`, which must outlive the codec.
template <typename Part, typename T>
OptionCodec word(T Part::*member,
                 std::type_identity_t<std::span<const option_values::Word<T>>> list) {
  WordValues values;
  for (const auto& one : list) values.words.push_back(one.text);
  return member_codec(
      member, std::move(values),
      [=](std::string_view name, std::string_view text) {
        return option_values::one_of<T>(name, text, list);
      },
      [=](T value) -> OptionText { return std::string(option_values::word_of<T>(value, list)); });
}

// N finite numbers, as read(name, text) takes them.
template <typename Part, size_t N,
          typename Read = Result<std::array<double, N>> (*)(std::string_view, std::string_view)>
OptionCodec numbers(std::optional<std::array<double, N>> Part::*member,
                    Read read = option_values::numbers<N>,
                    NumberListValues values = {.count_min = N, .count_max = N}) {
  return member_codec(member, values, read, [](const std::optional<std::array<double, N>>& value) {
    return text_if_set(value, [](const auto& set) { return option_values::to_text(set); });
  });
}

// "occupancy,color,…": all that `channels` takes.
std::string channel_names();

OptionCodec dims();
OptionCodec voxel_size();  // one number stands for three equal ones
OptionCodec bounds();
OptionCodec transform();
OptionCodec units();
OptionCodec channels();     // names of channels; occupancy is always there
OptionCodec one_channel();  // the name of a channel; occupancy stands for none
OptionCodec animation_name();
OptionCodec variant_name();
OptionCodec frames();  // FIRST..LAST, or one number
OptionCodec times();   // ascending seconds
OptionCodec format();
OptionCodec region();
OptionCodec blocks();   // names of groups and of blocks
OptionCodec palette();  // a count, a name or colours
OptionCodec keep();     // largest, or a count
OptionCodec remap();    // FROM:TO of labels
OptionCodec mirror();   // axes
OptionCodec background();
OptionCodec samples();  // auto, or a number
OptionCodec section();
OptionCodec filename();

}  // namespace voxeld::option_codecs
