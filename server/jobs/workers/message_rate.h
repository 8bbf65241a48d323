// A token bucket for the messages of one connection of a worker.
#pragma once

#include <algorithm>
#include <chrono>
#include <string>

#include "proto/result.h"

namespace voxeld {

// A worker reports five times a second, asks for the device up to 20 times a second, and hands over
// the frames and images of an animation as fast as it makes them. One that says more than this
// keeps the gateway busy: its connection ends. Not thread-safe.
class MessageRate {
 public:
  static constexpr double kPerSecondMax = 2000;
  static constexpr double kAtOnceMax = 10'000;

  // Takes one message into account. Errors: bad-request.
  Status take() {
    const auto now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - at_).count();
    left_ = std::min(left_ + seconds * kPerSecondMax, kAtOnceMax);
    at_ = now;
    if (left_ < 1) {
      return Error{ErrorCode::kBadRequest, "too many task messages",
                   "at most " + std::to_string(static_cast<int>(kPerSecondMax)) + " in a second",
                   "more"};
    }
    left_ -= 1;
    return {};
  }

 private:
  using Clock = std::chrono::steady_clock;
  double left_ = kAtOnceMax;
  Clock::time_point at_ = Clock::now();
};

}  // namespace voxeld
