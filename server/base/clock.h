// Clocks: the wall clock, a stopwatch, and the wall time of named stages for Server-Timing.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/messages/job.h"

namespace voxeld {

// Milliseconds since 1970, of the wall clock, which may jump.
inline int64_t unix_time_ms() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::milliseconds>(now).count();
}

// Milliseconds since construction or the last lap().
class Stopwatch {
 public:
  double ms() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  double lap() {
    const double elapsed = ms();
    start_ = Clock::now();
    return elapsed;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

// Adds `ms` to the stage. Stages are in the order of first use.
inline void add_stage(StageTimes& times, std::string_view stage, double ms) {
  for (auto& [name, total] : times) {
    if (name == stage) {
      total += ms;
      return;
    }
  }
  times.emplace_back(std::string(stage), ms);
}

}  // namespace voxeld
