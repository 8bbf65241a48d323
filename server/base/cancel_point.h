// Cancellation of long computations that know nothing about tasks: parsers, decoders, encoders.
//
// A task installs its flag with a CancelScope. Every loop whose length a file decides calls
// cancel_point(), which throws Cancelled once the flag is set. It is an exception because the loops
// are many levels deep, in code whose results do not concern tasks. One place catches it
// (server/worker/run_task.cpp).
//
// At most about 50 ms of work lie between two cancellation points; a worker logs what takes longer
// (server/worker/task/cancel_watch.h). Library calls that do are noted where they are made.
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace voxeld {

// Not a std::exception, so handlers of library exceptions do not catch it.
class Cancelled {};

class CancelScope;

namespace internal {
extern constinit thread_local const CancelScope* cancel_scope;
}  // namespace internal

// Applies to the calling thread, and to those that share its loops (server/base/parallel.h). Other
// threads that it starts have no scope. Scopes nest: an inner one is cancelled where an outer one
// is, and its points are also the outer's.
class CancelScope {
 public:
  explicit CancelScope(const std::atomic<bool>& flag)
      : flag_(flag), outer_(std::exchange(internal::cancel_scope, this)) {}
  ~CancelScope() { internal::cancel_scope = outer_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

  // Grows with the cancellation points that its threads pass. Any thread may ask.
  uint64_t points_passed() const { return points_passed_.load(std::memory_order_relaxed); }

 private:
  friend bool is_cancelled();
  bool pass_point() const {
    // Not one operation, which would cost more: where two threads count at once, one is lost.
    points_passed_.store(points_passed() + 1, std::memory_order_relaxed);
    const bool is_outer_cancelled = outer_ != nullptr && outer_->pass_point();
    return is_outer_cancelled || flag_.load(std::memory_order_relaxed);
  }

  const std::atomic<bool>& flag_;
  const CancelScope* const outer_;
  mutable std::atomic<uint64_t> points_passed_{0};
};

// Whether this thread's scope is cancelled; false without a scope. A cancellation point for
// callbacks of C libraries, which must not throw, and for loops that end by themselves.
inline bool is_cancelled() {
  const CancelScope* scope = internal::cancel_scope;
  return scope != nullptr && scope->pass_point();
}

// Lends the scope of another thread, or null, to the calling one. That thread must wait.
class BorrowedCancelScope {
 public:
  explicit BorrowedCancelScope(const CancelScope* scope)
      : outer_(std::exchange(internal::cancel_scope, scope)) {}
  ~BorrowedCancelScope() { internal::cancel_scope = outer_; }
  BorrowedCancelScope(const BorrowedCancelScope&) = delete;
  BorrowedCancelScope& operator=(const BorrowedCancelScope&) = delete;

 private:
  const CancelScope* const outer_;
};

// Throws Cancelled if this thread's scope is cancelled; does nothing without a scope. It takes a
// nanosecond, so a loop over vertices may call it.
inline void cancel_point() {
  if (is_cancelled()) [[unlikely]]
    throw Cancelled();
}

}  // namespace voxeld
