// A handle by which one thread resumes something that waits in another part of the daemon.
#pragma once

#include <functional>
#include <utility>

#include "server/base/thread_annotations.h"

namespace voxeld {

// Thread-safe. A waker may outlive what it wakes; wake() does nothing then.
class Waker {
 public:
  virtual ~Waker() = default;
  // Returns at once; what waits looks again on a thread of its own.
  virtual void wake() = 0;
};

// Calls a function until it is detached.
class CallbackWaker final : public Waker {
 public:
  explicit CallbackWaker(std::function<void()> call) : call_(std::move(call)) {}
  void wake() override EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (call_) call_();
  }
  // Returns when no call is running any more. The caller must not hold a lock that the call takes.
  void detach() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    call_ = nullptr;
  }

 private:
  Mutex mutex_;
  std::function<void()> call_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
