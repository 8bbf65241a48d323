#include "server/worker/frames/frame_times.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "proto/limits.h"
#include "proto/text/number_text.h"

namespace voxeld {
namespace {

// Tolerance in seconds: clients write times with few digits, and rates do not divide durations
// exactly.
constexpr double kTimeTolerance = 1e-6;
// glTF has times in single precision: an end may be this part of itself early.
constexpr double kFloatTolerance = 0x1p-24;

// The end of an animation in seconds, with the tolerances.
double end_of(const AnimationInfo& animation) {
  return animation.duration_s * (1.0 + kFloatTolerance) + kTimeTolerance;
}

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string frames_text(const std::array<int, 2>& frames) {
  const std::string first = std::to_string(frames[0]);
  return frames[0] == frames[1] ? first : first + ".." + std::to_string(frames[1]);
}

Status check_times(std::string_view option, const std::vector<double>& times_s,
                   const AnimationInfo& animation) {
  for (const double time_s : times_s) {
    if (time_s <= end_of(animation)) continue;
    return Error{ErrorCode::kInvalidOption,
                 std::string(option) + ": after the end of the animation",
                 "0 to " + short_number(animation.duration_s) + " seconds", short_number(time_s)};
  }
  return {};
}

Error too_many(int64_t count) {
  return {ErrorCode::kInvalidOption, "frames: too many at once",
          "at most " + std::to_string(limits::kFramesMax) + ", by frames=A..B or a lower fps",
          std::to_string(count)};
}

double rate_of(const AnimationOptions& options, const AnimationInfo& animation) {
  if (options.fps) return *options.fps;
  return animation.frame_rate > 0.0 ? animation.frame_rate : kDefaultFps;
}

}  // namespace

Result<FrameTimes> frame_times(const AnimationOptions& options, const AnimationInfo& animation) {
  if (options.time_s) {
    VOXELD_TRY(check_times("time", {*options.time_s}, animation));
    return FrameTimes{{*options.time_s}, 0.0};
  }
  if (!options.times_s.empty()) {
    VOXELD_TRY(check_times("times", options.times_s, animation));
    if (options.times_s.size() > limits::kFramesMax) {
      return too_many(static_cast<int64_t>(options.times_s.size()));
    }
    return FrameTimes{options.times_s, 0.0};
  }
  FrameTimes found{{}, rate_of(options, animation)};
  const double last = std::floor(end_of(animation) * found.fps);
  const double count = std::max(last, 0.0) + 1.0;
  // Without `frames` the count may be any number; 1e15 fits into a size_t.
  const double counted = std::min(count, 1e15);
  VOXELD_ASSIGN(const FrameSelection range,
                select_frames(options.frames, static_cast<size_t>(counted)));
  const size_t asked = range.end - range.begin;
  if (asked > limits::kFramesMax) return too_many(static_cast<int64_t>(asked));
  for (size_t k = range.begin; k < range.end; ++k) {
    found.times_s.push_back(static_cast<double>(k) / found.fps);
  }
  return found;
}

Result<FrameSelection> select_frames(const std::optional<std::array<int, 2>>& frames,
                                     size_t count) {
  if (!frames) return FrameSelection{0, count};
  const auto [first, last] = *frames;
  if (first >= 0 && first <= last && static_cast<size_t>(last) < count) {
    return FrameSelection{static_cast<size_t>(first), static_cast<size_t>(last) + 1};
  }
  return Error{ErrorCode::kInvalidOption, "frames: there are " + std::to_string(count) + " frames",
               index_text(count, "frames"), frames_text(*frames)};
}

std::vector<double> frame_durations(const std::vector<double>& times_s, double fps) {
  std::vector<double> durations_s;
  for (size_t k = 0; k + 1 < times_s.size(); ++k) {
    durations_s.push_back(times_s[k + 1] - times_s[k]);
  }
  const bool is_alone = durations_s.empty();
  durations_s.push_back(is_alone ? 1.0 / (fps > 0.0 ? fps : kDefaultFps) : durations_s.back());
  return durations_s;
}

}  // namespace voxeld
