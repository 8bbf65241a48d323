// How much may go by age alone: whatever makes all of it old at once, most of it is still there
// when somebody notices.
#pragma once

#include <cstdint>
#include <functional>

#include "proto/result.h"

namespace voxeld {

// For one kind of thing that is kept for `keep_days`. One thread.
class AgeBudget {
 public:
  static constexpr int64_t kWindowMs = int64_t{60} * 60 * 1000;
  // Part of the stored bytes that may expire within a window. If things are kept for a short time,
  // four times the average, so that a busy daemon keeps up; all of them if that is four windows.
  static constexpr double kShare = 0.1, kAverages = 4.0;

  explicit AgeBudget(double keep_days) : keep_days_(keep_days) {}
  // How many may go now. `count` is asked how many there are when a window begins.
  Result<int64_t> left(int64_t kept_now_ms, const std::function<Result<int64_t>()>& count);
  // So many went.
  void take(int64_t count) { left_ -= count; }
  // Once for each window in which nothing is left.
  bool take_exhausted();

 private:
  const double keep_days_;
  int64_t window_end_ms_ = 0;
  int64_t left_ = 0;
  bool was_told_ = false;
};

}  // namespace voxeld
