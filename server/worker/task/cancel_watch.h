// Measures how long a task works between two cancellation points (server/base/cancel_point.h).
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "server/base/cancel_point.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// A thread of its own looks at the scope every kPeriod. What counts is the time that passes, or the
// CPU time of the process where that is shorter: a task that waits, or whose processor is taken by
// others, could not reach a point.
class CancelWatch {
 public:
  static constexpr std::chrono::milliseconds kPeriod{10};
  // Longer distances are defects.
  static constexpr double kDistanceMsMax = 50;

  struct Distance {
    double ms = 0;  // too short by up to two periods
    std::string stage;
  };

  // `stage` names what the task does, `tick` is called every kPeriod; both on the watch's thread.
  // All outlive the watch.
  CancelWatch(const CancelScope& scope, std::function<std::string()> stage,
              std::function<void()> tick);
  ~CancelWatch();
  CancelWatch(const CancelWatch&) = delete;
  CancelWatch& operator=(const CancelWatch&) = delete;

  // The longest distance until now, with that which has not ended yet.
  Distance longest() const EXCLUDES(mutex_);

 private:
  void run() EXCLUDES(mutex_);
  void look() REQUIRES(mutex_);

  using Clock = std::chrono::steady_clock;
  const CancelScope& scope_;
  const std::function<std::string()> stage_;
  const std::function<void()> tick_;
  mutable Mutex mutex_;
  CondVar wake_;
  bool ending_ GUARDED_BY(mutex_) = false;
  // As of the last look.
  Clock::time_point looked_at_ GUARDED_BY(mutex_);
  double cpu_ms_ GUARDED_BY(mutex_);
  double since_point_ms_ GUARDED_BY(mutex_) = 0;
  Distance longest_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
