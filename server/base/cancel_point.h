// Cancellation of long computations that know nothing about tasks: parsers, decoders, encoders.
//
// A task installs its flag with a CancelScope. Every loop whose length a file decides calls
// cancel_point(), which throws Cancelled once the flag is set. It is an exception because the loops
// are many levels deep, in code whose results do not concern tasks. One place catches it
// (server/worker/run_task.cpp).
//
// At most about 50 ms of work lie between two cancellation points. Library calls that take longer
// are noted where they are made.
#pragma once

#include <atomic>
#include <utility>

namespace voxeld {

// Not a std::exception, so handlers of library exceptions do not catch it.
class Cancelled {};

namespace internal {
extern constinit thread_local const std::atomic<bool>* cancel_flag;
}  // namespace internal

// Whether this thread's scope is cancelled; false without a scope. For callbacks of C libraries,
// which must not throw.
inline bool is_cancelled() {
  const std::atomic<bool>* flag = internal::cancel_flag;
  return flag != nullptr && flag->load(std::memory_order_relaxed);
}

// Throws Cancelled if this thread's scope is cancelled; does nothing without a scope. It takes a
// nanosecond, so a loop over vertices may call it.
inline void cancel_point() {
  if (is_cancelled()) [[unlikely]]
    throw Cancelled();
}

// Applies to the calling thread only: threads that it starts have no scope. Scopes nest.
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
