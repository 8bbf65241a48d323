// The times of a request's frames in an animation.
#pragma once

#include <vector>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/scene/core/animated_scene.h"

namespace voxeld {

// The rate of an animation without one of its own.
inline constexpr double kDefaultFps = 24.0;

struct FrameTimes {
  std::vector<double> times_s;  // ascending; one or more
  double fps = 0.0;             // 0: the frames have times of their own
};

// Frame k is at time k / fps, for all k that are not after the animation's end; `frames` selects
// some. Times that the request lists are used as they are, and `time` is one of them. Errors:
// invalid-option for frames or times after the end, with the number of frames or the duration, and
// for more than limits::kFramesMax.
Result<FrameTimes> frame_times(const AnimationOptions& options, const AnimationInfo& animation);

// The frames of `count` that `frames` selects: the first, and the one after the last. Errors:
// invalid-option with the number of frames.
struct FrameSelection {
  size_t begin = 0, end = 0;
};
Result<FrameSelection> select_frames(const std::optional<std::array<int, 2>>& frames, size_t count);

// How long each frame is shown: until the next one. The last is shown as long as the one before it.
// A single frame is shown for one frame at `fps` (0: kDefaultFps).
std::vector<double> frame_durations(const std::vector<double>& times_s, double fps);

}  // namespace voxeld
