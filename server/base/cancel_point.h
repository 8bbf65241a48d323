// Cancellation of long computations that do not know of tasks: parsers, decoders, encoders.
//
// A task installs its flag with a CancelScope; every loop whose length a file decides calls
// cancel_point(), which throws Cancelled once the flag is set. An exception, because the loops are
// many levels deep in code whose results have nothing to do with tasks; it is caught in one place
// (server/worker/run_task.cpp). Between two cancel points lie at most about 50 ms of work; a call
// of a library that takes longer is named where it is made.
#pragma once

#include <atomic>
#include <utility>

namespace voxeld {

// Not a std::exception: handlers of what libraries throw let it pass.
class Cancelled {};

namespace internal {
extern constinit thread_local const std::atomic<bool>* cancel_flag;
}  // namespace internal

// Whether this thread's scope is cancelled; false without a scope. For callbacks of C libraries,
// through which nothing may be thrown.
inline bool is_cancelled() {
  const std::atomic<bool>* flag = internal::cancel_flag;
  return flag != nullptr && flag->load(std::memory_order_relaxed);
}

// Throws Cancelled where this thread's scope is cancelled; without a scope nothing. A nanosecond:
// may stand in a loop over vertices.
inline void cancel_point() {
  if (is_cancelled()) [[unlikely]]
    throw Cancelled();
}

// Covers the calling thread alone: threads that it starts have no cancel points. Scopes nest.
class CancelScope {
 public:
  explicit CancelScope(const std::atomic<bool>& flag)
      : outer_(std::exchange(internal::cancel_flag, &flag)) {}
  ~CancelScope() { internal::cancel_flag = outer_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  const std::atomic<bool>* const outer_;
};

}  // namespace voxeld
