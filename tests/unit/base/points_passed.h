// Cancellation points, counted.
#pragma once

#include <atomic>

#include "server/base/cancel_point.h"

namespace voxeld::test {

// The cancellation points that work() passes, on all threads.
template <typename Work>
int points_passed(const Work& work) {
  const std::atomic<bool> flag{false};
  std::atomic<int> passed{0};
  Pause pause;
  pause.is_due = true;
  pause.take = [&] {
    ++passed;
    return true;
  };
  const CancelScope scope(flag, &pause);
  work();
  return passed;
}

}  // namespace voxeld::test
