// The clock of retention and of deadlines. It follows the running time of the machine, not the wall
// clock, whose jumps would make results old or jobs late.
#pragma once

#include <cstdint>
#include <functional>

#include "server/base/thread_annotations.h"

namespace voxeld {

// Kept time is milliseconds that begin as Unix time with a new store and then count what the
// machine runs, with its suspends. The time between two processes is taken from the wall clock, but
// as kStoppedMsMax at most. Thread-safe.
class KeptClock {
 public:
  static constexpr int64_t kStoppedMsMax = int64_t{24} * 60 * 60 * 1000;
  // A smaller step of the wall clock is not reported.
  static constexpr int64_t kJumpMsMin = int64_t{60} * 1000;

  struct Sources {
    std::function<int64_t()> wall_ms;    // Unix time
    std::function<int64_t()> steady_ms;  // since the machine started
  };
  static Sources real();

  // The time that the last process saved, and the wall clock at that moment; zeros: none was saved.
  KeptClock(Sources sources, int64_t saved_kept_ms, int64_t saved_wall_ms);
  int64_t now_ms() const { return first_kept_ms_ + sources_.steady_ms() - first_steady_ms_; }
  int64_t wall_ms() const { return sources_.wall_ms(); }
  // The time between the last process and this one, at most kStoppedMsMax.
  int64_t stopped_ms() const { return stopped_ms_; }
  // The jump of the wall clock since the last call: its change without the time that passed; 0 for
  // less than kJumpMsMin.
  int64_t take_jump_ms() EXCLUDES(mutex_);

 private:
  const Sources sources_;
  int64_t first_steady_ms_ = 0;
  int64_t first_kept_ms_ = 0;
  int64_t stopped_ms_ = 0;
  Mutex mutex_;
  int64_t ahead_ms_ GUARDED_BY(mutex_) = 0;  // of the wall clock before kept time
};

}  // namespace voxeld
