// At which times of an animation a request's frames are.
#pragma once

#include <vector>

#include "proto/options.h"
#include "proto/result.h"
#include "server/scene/animated_scene.h"

namespace voxeld {

// Of an animation that tells no rate of its own.
inline constexpr double kDefaultFps = 24.0;

struct FrameTimes {
  std::vector<double> times_s;  // ascending; one or more
  double fps = 0.0;             // 0: at times of their own
};

// Frame k is at time k / fps, for all k that are not after the animation's end; `frames` takes a
// part of them. Times of the request's own are taken as they are, and `time` is one of them.
// Errors: invalid-option for frames or times after the end, which says how many frames there are
// or how long the animation is, and for more than limits::kFramesMax.
Result<FrameTimes> frame_times(const AnimationOptions& options, const AnimationInfo& animation);

// The frames of `count` that `frames` selects: first, and the one after the last. Errors:
// invalid-option that says how many there are.
struct FrameRange {
  size_t begin = 0, end = 0;
};
Result<FrameRange> select_frames(const std::optional<std::array<int, 2>>& frames, size_t count);

// How long each of the frames is seen: until the next one; the last one as long as the one before
// it or, where it is alone, for one frame at `fps` (0: kDefaultFps).
std::vector<double> frame_durations(const std::vector<double>& times_s, double fps);

}  // namespace voxeld
