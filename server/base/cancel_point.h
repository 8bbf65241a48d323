// Cancellation of long computations that know nothing about tasks: parsers, decoders, encoders.
//
// A task installs its flag with a CancelScope. Every loop whose length a file decides calls
// cancel_point(), which throws Cancelled once the flag is set. It is an exception because the loops
// are many levels deep, in code whose results do not concern tasks. One place catches it
// (server/worker/run_task.cpp).
//
// At most about 50 ms of work lie between two cancellation points; a worker logs what takes longer
// (server/worker/task/cancel_watch.h). Library calls that do are noted where they are made.
//
// The same points let other tasks go first (Pause): a task gives its time slice back within the
// same time, whatever it works on.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <utility>

namespace voxeld {

// Not a std::exception, so handlers of library exceptions do not catch it.
class Cancelled {};

class CancelScope;

namespace internal {
extern constinit thread_local const CancelScope* cancel_scope;
}  // namespace internal

// A pause that the threads of a scope make at their next cancellation points once it is due.
struct Pause {
  std::atomic<bool> is_due{false};
  // Waits until the pause is over, which is then no longer due. Several threads may call it at
  // once; it must not throw. False: the scope ends as if it were cancelled; the pause stays due.
  std::function<bool()> take;
};

// Applies to the calling thread, and to those that share its loops (server/base/parallel.h). Other
// threads that it starts have no scope. Scopes nest: an inner one is cancelled where an outer one
// is, and its points are also the outer's.
class CancelScope {
 public:
  // Without `pause` there is none. Both outlive the scope.
  explicit CancelScope(const std::atomic<bool>& flag, const Pause* pause = nullptr)
      : flag_(flag), pause_(pause), outer_(std::exchange(internal::cancel_scope, this)) {}
  ~CancelScope() { internal::cancel_scope = outer_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

  // Whether a thread has passed a cancellation point since the last call. For one caller, on any
  // thread.
  bool has_passed_points() const { return !is_awaited_.exchange(true); }

 private:
  friend bool is_cancelled();
  bool pass_point() const {
    // Written only where somebody awaits it, so that the threads of a loop share the cache line.
    if (is_awaited_.load(std::memory_order_relaxed)) {
      is_awaited_.store(false, std::memory_order_relaxed);
    }
    if (pause_ != nullptr && pause_->is_due.load(std::memory_order_relaxed)) [[unlikely]] {
      if (!pause_->take()) return true;
    }
    const bool is_outer_cancelled = outer_ != nullptr && outer_->pass_point();
    return is_outer_cancelled || flag_.load(std::memory_order_relaxed);
  }

  const std::atomic<bool>& flag_;
  const Pause* const pause_;
  const CancelScope* const outer_;
  mutable std::atomic<bool> is_awaited_{true};
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
