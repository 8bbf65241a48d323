#include "server/worker/frames/frame_times.h"

#include <gtest/gtest.h>

#include <string>

#include "proto/limits.h"

namespace voxeld {
namespace {

const AnimationInfo kWalk{"walk", 25, 24.0, 1.0};
const AnimationInfo kKeys{"keys", 0, 0.0, 0.5};

template <typename T>
std::string message_of(const Result<T>& result) {
  return result.ok() ? "ok" : result.error().message();
}

AnimationOptions with_frames(int first, int last) {
  AnimationOptions options;
  options.frames = {first, last};
  return options;
}

TEST(FrameTimes, all_frames_at_the_animations_own_rate_with_its_last_one) {
  const auto times = frame_times({}, kWalk);
  ASSERT_TRUE(times.ok());
  EXPECT_EQ(times->fps, 24.0);
  ASSERT_EQ(times->times_s.size(), 25u);
  EXPECT_EQ(times->times_s.front(), 0.0);
  EXPECT_EQ(times->times_s[7], 7.0 / 24.0);
  EXPECT_EQ(times->times_s.back(), 1.0);
}

TEST(FrameTimes, keys_at_times_of_their_own_are_sampled_24_times_a_second) {
  const auto times = frame_times({}, kKeys);
  ASSERT_TRUE(times.ok());
  EXPECT_EQ(times->fps, kDefaultFps);
  EXPECT_EQ(times->times_s.size(), 13u);
}

TEST(FrameTimes, another_rate_gives_the_frames_that_are_not_after_the_end) {
  AnimationOptions options;
  options.fps = 10.0;
  EXPECT_EQ(frame_times(options, kKeys)->times_s.size(), 6u);
  options.fps = 9.0;  // 4.5 frames
  EXPECT_EQ(frame_times(options, kKeys)->times_s.size(), 5u);
  options.fps = 1.0;
  EXPECT_EQ(frame_times(options, kKeys)->times_s.size(), 1u);
  // 139 frames at 1/24 s: the product is not 139 exactly.
  const AnimationInfo bob{"bob", 140, 24.0, 139.0 / 24.0};
  EXPECT_EQ(frame_times({}, bob)->times_s.size(), 140u);
}

TEST(FrameTimes, an_end_in_single_precision_has_its_frame) {
  for (const int last : {50, 100, 2399}) {
    // glTF's time of key `last` at 24 frames a second, which may be less than the number.
    const AnimationInfo keys{"keys", 0, 0.0, double{static_cast<float>(last / 24.0)}};
    const auto times = frame_times({}, keys);
    ASSERT_TRUE(times.ok()) << last;
    EXPECT_EQ(times->times_s.size(), static_cast<size_t>(last) + 1) << last;
    AnimationOptions options;
    options.time_s = times->times_s.back();
    EXPECT_TRUE(frame_times(options, keys).ok()) << last;
  }
}

TEST(FrameTimes, a_part_of_the_frames_keeps_their_times) {
  const auto times = frame_times(with_frames(3, 5), kWalk);
  ASSERT_TRUE(times.ok());
  EXPECT_EQ(times->times_s, (std::vector<double>{3.0 / 24, 4.0 / 24, 5.0 / 24}));
  EXPECT_EQ(frame_times(with_frames(24, 24), kWalk)->times_s, std::vector<double>{1.0});
}

TEST(FrameTimes, frames_after_the_end_are_refused_with_their_number) {
  EXPECT_EQ(message_of(frame_times(with_frames(3, 25), kWalk)),
            "frames: there are 25 frames: expected 0 to 24, got 3..25");
  EXPECT_EQ(message_of(frame_times(with_frames(99, 99), kWalk)),
            "frames: there are 25 frames: expected 0 to 24, got 99");
}

TEST(FrameTimes, one_frame_and_none_are_no_ranges) {
  const std::array<int, 2> frames = {1, 1};
  EXPECT_EQ(message_of(select_frames(frames, 1)), "frames: there are 1 frames: expected 0, got 1");
  EXPECT_EQ(message_of(select_frames(frames, 0)),
            "frames: there are 0 frames: expected none, as there are no frames, got 1");
}

TEST(FrameTimes, times_of_the_requests_own_are_taken_as_they_are) {
  AnimationOptions options;
  options.times_s = {0.0, 0.11, 1.0};
  const auto times = frame_times(options, kWalk);
  ASSERT_TRUE(times.ok());
  EXPECT_EQ(times->times_s, options.times_s);
  EXPECT_EQ(times->fps, 0.0);
  options.times_s.push_back(1.25);
  EXPECT_EQ(message_of(frame_times(options, kWalk)),
            "times: after the end of the animation: expected 0 to 1 seconds, got 1.25");
}

TEST(FrameTimes, one_time_is_one_frame) {
  AnimationOptions options;
  options.time_s = 0.3;
  EXPECT_EQ(frame_times(options, kWalk)->times_s, std::vector<double>{0.3});
  options.time_s = 7.0;
  EXPECT_EQ(message_of(frame_times(options, kWalk)),
            "time: after the end of the animation: expected 0 to 1 seconds, got 7");
}

TEST(FrameTimes, more_frames_than_one_request_may_ask_for_are_refused) {
  AnimationOptions options;
  options.fps = 1000.0;
  const AnimationInfo hour{"hour", 0, 0.0, 3600.0};
  EXPECT_EQ(message_of(frame_times(options, hour)),
            "frames: too many at once: expected at most 4096, by frames=A..B or a lower fps, got "
            "3600001");
  options.frames = {1'000'000, 1'000'000 + limits::kFramesMax - 1};
  EXPECT_EQ(frame_times(options, hour)->times_s.size(), size_t{limits::kFramesMax});
}

TEST(FrameTimes, an_animation_of_one_pose_has_one_frame) {
  EXPECT_EQ(frame_times({}, AnimationInfo{"still", 1, 24.0, 0.0})->times_s,
            std::vector<double>{0.0});
}

TEST(FrameDurations, frames_are_seen_until_the_next_one) {
  EXPECT_EQ(frame_durations({0.0, 0.25, 1.0}, 0.0), (std::vector<double>{0.25, 0.75, 0.75}));
  EXPECT_EQ(frame_durations({0.5}, 10.0), std::vector<double>{0.1});
  EXPECT_EQ(frame_durations({0.5}, 0.0), std::vector<double>{1.0 / kDefaultFps});
}

}  // namespace
}  // namespace voxeld
