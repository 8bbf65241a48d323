// Lets the server end long work of the codecs, which clients share with it.
#pragma once

#include <atomic>
#include <cstddef>

namespace voxeld {

// Null, or a function that may throw; the server sets it (server/base/cancel_point.h).
inline constinit std::atomic<void (*)()> work_point_function{nullptr};

// Called every few milliseconds of work.
inline void work_point() {
  if (const auto call = work_point_function.load(std::memory_order_relaxed)) call();
}

// A work point for every 65536th number, for steps of a few nanoseconds.
inline void work_point_at(size_t number) {
  if (number % 65536 == 0) work_point();
}

}  // namespace voxeld
