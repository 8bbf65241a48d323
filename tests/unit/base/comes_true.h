// Polling with a deadline that only ends a hung test.
#pragma once

#include <chrono>
#include <thread>

namespace voxeld::testing {

// Tests wait for so long before they fail. It measures nothing: events come within milliseconds on
// an idle machine, and a busy one must not reach it.
inline constexpr std::chrono::seconds kPatience{60};

// Polls until `condition` is true; false after kPatience.
template <typename Condition>
[[nodiscard]] bool comes_true(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace voxeld::testing
