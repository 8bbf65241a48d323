// A thread beside the one that runs a task.
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <thread>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// Does one thing after another, in the order in which they were given. After an error it does
// nothing more. One thread gives work; exceptions of the work are thrown again there.
class SideThread {
 public:
  // bytes_max: of what waits, as push() is told; one thing more than fits is not waited with.
  explicit SideThread(size_t bytes_max);
  // What still waits is not done.
  ~SideThread();
  SideThread(const SideThread&) = delete;
  SideThread& operator=(const SideThread&) = delete;

  // Waits where too much waits already. Errors: the first of the work's so far; it is not done.
  Status push(size_t bytes, std::function<Status()> work) EXCLUDES(mutex_);
  // Until all is done. Errors: the first of the work's.
  Status wait() EXCLUDES(mutex_);

 private:
  struct Item {
    size_t bytes;
    std::function<Status()> work;
  };
  void run() EXCLUDES(mutex_);
  Status outcome() REQUIRES(mutex_);

  const size_t bytes_max_;
  Mutex mutex_;
  CondVar changed_;
  std::deque<Item> items_ GUARDED_BY(mutex_);  // the first is being done
  size_t bytes_ GUARDED_BY(mutex_) = 0;
  bool ending_ GUARDED_BY(mutex_) = false;
  std::optional<Error> error_ GUARDED_BY(mutex_);
  std::exception_ptr thrown_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
