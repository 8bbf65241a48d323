#include "server/jobs/retention/kept_clock.h"
#include "server/base/clock.h"

#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace voxeld {
namespace {

int64_t boot_time_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

}  // namespace

KeptClock::Sources KeptClock::real() {
  return {unix_time_ms, boot_time_ms};
}

KeptClock::KeptClock(Sources sources, int64_t saved_kept_ms, int64_t saved_wall_ms)
    : sources_(std::move(sources)) {
  const int64_t wall = sources_.wall_ms();
  first_steady_ms_ = sources_.steady_ms();
  first_kept_ms_ = wall;
  if (saved_kept_ms > 0) {
    stopped_ms_ = std::clamp<int64_t>(wall - saved_wall_ms, 0, kStoppedMsMax);
    first_kept_ms_ = saved_kept_ms + stopped_ms_;
  }
  ahead_ms_ = wall - first_kept_ms_;
}

int64_t KeptClock::take_jump_ms() {
  const int64_t ahead = wall_ms() - now_ms();
  const MutexLock lock(mutex_);
  const int64_t jump = ahead - ahead_ms_;
  if (std::abs(jump) < kJumpMsMin) return 0;
  ahead_ms_ = ahead;
  return jump;
}

}  // namespace voxeld
