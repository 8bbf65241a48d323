// Waits with an end, by polling: only the end of a server waits like this.
#pragma once

#include <chrono>
#include <thread>

#include "server/http/message/message.h"

namespace voxeld::http {

inline Clock::time_point from_now(double seconds) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// Returns when the condition is false, or at `end`.
template <typename Condition>
void wait_while(const Condition& condition, Clock::time_point end) {
  constexpr auto kStep = std::chrono::milliseconds(10);
  while (condition() && Clock::now() < end) std::this_thread::sleep_for(kStep);
}

}  // namespace voxeld::http
