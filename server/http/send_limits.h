// When a response is cut because its client does not take it.
#pragma once

#include <cstdint>

namespace voxeld::http {

// A client that takes nothing of a response for so long is cut off.
inline constexpr int kWriteStallSeconds = 30;
// Average bytes per second of a response that its client must take after the first seconds.
inline constexpr int64_t kSendRateMin = 4096;
inline constexpr int kSendGraceSeconds = 60;

// The same for a download that keeps room on the disk from others: its file was deleted, or the
// disk is short.
inline constexpr int kPressedStallSeconds = 5;
inline constexpr int kPressedGraceSeconds = 10;

struct SendLimits {
  double stall_seconds = kWriteStallSeconds;  // without a byte
  double grace_seconds = kSendGraceSeconds;   // until the average counts
  int64_t rate_min = kSendRateMin;
  // The first two, for a download that keeps room from others.
  double pressed_stall_seconds = kPressedStallSeconds, pressed_grace_seconds = kPressedGraceSeconds;
};

}  // namespace voxeld::http
