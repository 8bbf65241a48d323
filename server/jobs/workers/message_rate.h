// A token bucket for the messages of one connection of a worker.
#pragma once

#include <algorithm>
#include <chrono>
#include <string>

#include "proto/result.h"
#include "server/jobs/model/worker_state.h"

namespace voxeld {

// TaskLimits::messages_per_second_max and messages_at_once_max. Not thread-safe.
class MessageRate {
 public:
  explicit MessageRate(const TaskLimits& limits)
      : per_second_max_(limits.messages_per_second_max),
        at_once_max_(limits.messages_at_once_max) {}

  // Takes one message into account. Errors: bad-request.
  Status take() {
    const auto now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - at_).count();
    left_ = std::min(left_ + seconds * per_second_max_, at_once_max_);
    at_ = now;
    if (left_ < 1) {
      return Error{ErrorCode::kBadRequest, "too many task messages",
                   "at most " + std::to_string(static_cast<int>(per_second_max_)) + " in a second",
                   "more"};
    }
    left_ -= 1;
    return {};
  }

 private:
  using Clock = std::chrono::steady_clock;
  double per_second_max_, at_once_max_;
  double left_ = at_once_max_;
  Clock::time_point at_ = Clock::now();
};

}  // namespace voxeld
