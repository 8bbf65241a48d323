#include "proto/options/rules.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "proto/client_texts.h"
#include "proto/limits.h"
#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld::option_rules {
namespace {

using namespace option_values;
namespace words = option_words;

constexpr std::array<std::string_view, 6> kAnimationOptions = {"animation", "time",  "frames",
                                                               "fps",       "times", "root_motion"};
constexpr std::array<std::string_view, 5> kPictureOptions = {"picture", "frame", "turntable",
                                                             "rate", "columns"};

constexpr double kAnimationSecondsMax = 86'400;  // a day: invalid-option
constexpr double kFpsMin = 0.01, kFpsMax = 1000;
constexpr int kTurntableMin = 2, kTurntableMax = 360;
constexpr double kRateMin = 0.1, kRateMax = 100;

// Canonical JSON holds the animation's name, and JSON must be UTF-8.
bool is_utf8(std::string_view text) {
  using Handler = nlohmann::json::error_handler_t;
  const nlohmann::json json(text);
  return json.dump(-1, ' ', false, Handler::replace) == json.dump(-1, ' ', false, Handler::ignore);
}

Status set_name(AnimationOptions& animation, std::string_view text) {
  if (text.empty() || text.size() > client_texts::kAnimation.bytes_max ||
      text.find('\0') != std::string_view::npos || !is_utf8(text)) {
    return invalid("animation", "a name or number: 1 to 255 bytes of UTF-8 without NUL", text);
  }
  animation.animation = text;
  return {};
}

Status set_frames(AnimationOptions& animation, std::string_view text) {
  const Error wrong =
      invalid("frames",
              "FIRST..LAST, or one number: integers from 0 on, the first not above the "
              "last",
              text);
  const size_t dots = text.find("..");
  const auto first = parse_int(text.substr(0, dots));
  const auto last = dots == std::string_view::npos ? first : parse_int(text.substr(dots + 2));
  if (!first || !last || *first < 0 || *last < *first) return wrong;
  if (*last - *first >= limits::kFramesMax) {
    return invalid("frames", "at most " + std::to_string(limits::kFramesMax) + " of them", text);
  }
  animation.frames = {*first, *last};
  return {};
}

Status set_times(AnimationOptions& animation, std::string_view text) {
  const auto parts = split(text);
  if (parts.size() > static_cast<size_t>(limits::kFramesMax)) {
    return invalid("times", "at most " + std::to_string(limits::kFramesMax) + " times",
                   std::to_string(parts.size()));
  }
  animation.times_s.clear();
  for (const std::string_view part : parts) {
    const auto value = parse_double(part);
    const bool ascends = animation.times_s.empty() || (value && *value > animation.times_s.back());
    if (!value || *value < 0 || *value > kAnimationSecondsMax || !ascends) {
      return invalid("times",
                     "T0,T1,…: seconds from 0 to " + to_text(kAnimationSecondsMax) +
                         ", each above the one before it",
                     text);
    }
    animation.times_s.push_back(*value);
  }
  return {};
}

template <typename Number>
Status set_between(std::optional<Number>& field, std::string_view name, std::string_view text,
                   double min, double max) {
  VOXELD_ASSIGN(field, number_between(name, text, min, max));
  return {};
}

Status set_int(int& field, std::string_view name, std::string_view text, int min, int max) {
  VOXELD_ASSIGN(field, int_between(name, text, min, max));
  return {};
}

template <typename Enum, size_t N>
Status set_word(Enum& field, std::string_view name, std::string_view text,
                const std::array<Word<Enum>, N>& list) {
  VOXELD_ASSIGN(field, (one_of<Enum>(name, text, list)));
  return {};
}

std::string_view first_given(const Given& given, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    if (given.contains(name)) return name;
  }
  return {};
}

// The number of frames that the request names; 0: as many as the input has.
int frames_named(const AnimationOptions& animation) {
  if (animation.frames) return (*animation.frames)[1] - (*animation.frames)[0] + 1;
  return static_cast<int>(animation.times_s.size());
}

Status check_frame(const RequestOptions& options, OptionScope scope) {
  const std::string got = std::to_string(options.render.frame);
  if (options.render.picture != PictureKind::kPng) {
    return invalid("frame", "picture png with it",
                   word_of<PictureKind>(options.render.picture, words::kPicture));
  }
  if (scope == OptionScope::kRenderMesh && !options.animation.is_sequence()) {
    return invalid("frame", "frames of an animation, and not its time", got);
  }
  const int named = frames_named(options.animation);
  if (named > 0 && options.render.frame >= named) {
    return invalid("frame",
                   "less than " + std::to_string(named) +
                       ", the number of frames that are asked "
                       "for",
                   got);
  }
  return {};
}

Status check_turntable(const RequestOptions& options, std::string_view picture) {
  if (options.render.picture == PictureKind::kPng) {
    return invalid("turntable", "picture gif, apng or sheet with it", picture);
  }
  if (options.render.matrix) return invalid("turntable", "a camera without matrix", "matrix");
  if (options.animation.is_sequence()) {
    return invalid("turntable", "one grid: no animation, or its time", "frames of an animation");
  }
  return {};
}

}  // namespace

bool is_animation_option(std::string_view name) {
  return std::ranges::find(kAnimationOptions, name) != kAnimationOptions.end();
}
bool is_picture_option(std::string_view name) {
  return std::ranges::find(kPictureOptions, name) != kPictureOptions.end();
}

Status set_animation(AnimationOptions& animation, std::string_view name, std::string_view text) {
  if (name == "animation") return set_name(animation, text);
  if (name == "time") return set_between(animation.time_s, name, text, 0, kAnimationSecondsMax);
  if (name == "frames") return set_frames(animation, text);
  if (name == "fps") return set_between(animation.fps, name, text, kFpsMin, kFpsMax);
  if (name == "times") return set_times(animation, text);
  return set_word(animation.root_motion, name, text, words::kRootMotion);
}

Status set_picture(RenderOptions& render, std::string_view name, std::string_view text) {
  if (name == "picture") return set_word(render.picture, name, text, words::kPicture);
  if (name == "frame") return set_int(render.frame, name, text, 0, limits::kFramesMax - 1);
  if (name == "turntable") {
    return set_int(render.turntable, name, text, kTurntableMin, kTurntableMax);
  }
  if (name == "rate") return set_between(render.rate, name, text, kRateMin, kRateMax);
  return set_int(render.columns, name, text, 1, limits::kFramesMax);
}

void complete_animation(RequestOptions& options, OptionScope scope, const Given& given) {
  const RenderOptions& render = options.render;
  const bool shows_frames =
      scope == OptionScope::kRenderMesh &&
      (given.contains("frame") || (render.picture != PictureKind::kPng && render.turntable == 0));
  const bool of_mesh = scope == OptionScope::kRenderMesh || scope == OptionScope::kVoxelize;
  AnimationOptions& animation = options.animation;
  if (!of_mesh || animation.animation || !(animation.moves() || shows_frames)) return;
  animation.animation = "0";
}

Status check_animation(const AnimationOptions& animation, const Given& given) {
  const auto other = first_given(given, {"frames", "fps", "times"});
  if (given.contains("time") && !other.empty()) {
    return invalid("time", "neither frames, fps nor times with it", other);
  }
  const auto even = first_given(given, {"frames", "fps"});
  if (given.contains("times") && !even.empty()) {
    return invalid("times", "neither frames nor fps with it", even);
  }
  if (given.contains("root_motion") && !animation.moves()) {
    return invalid("root_motion", "animation, time, frames, fps or times with it", "none of them");
  }
  return {};
}

Status check_picture(const RequestOptions& options, OptionScope scope, const Given& given) {
  const RenderOptions& render = options.render;
  const std::string_view picture = word_of<PictureKind>(render.picture, words::kPicture);
  const bool moves = render.picture == PictureKind::kGif || render.picture == PictureKind::kApng;
  if (given.contains("rate") && !moves) {
    return invalid("rate", "picture gif or apng with it", picture);
  }
  if (given.contains("columns") && render.picture != PictureKind::kSheet) {
    return invalid("columns", "picture sheet with it", picture);
  }
  if (given.contains("frame")) VOXELD_TRY(check_frame(options, scope));
  if (given.contains("turntable")) VOXELD_TRY(check_turntable(options, picture));
  const bool is_several = options.animation.is_sequence() || render.turntable > 0;
  if (scope == OptionScope::kRenderMesh && render.picture != PictureKind::kPng && !is_several) {
    return invalid("picture", "frames of an animation, or turntable with it", picture);
  }
  return {};
}

}  // namespace voxeld::option_rules
