// A thread for work beside the thread that runs a task.
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <thread>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// Runs items one after another, in order. After an error it runs no more. One thread pushes items;
// their exceptions are rethrown there.
class SideThread {
 public:
  // bytes_max: limit of the waiting items' bytes, as push() is told. A single larger item does not
  // wait.
  explicit SideThread(size_t bytes_max);
  // Drops the items that still wait.
  ~SideThread();
  SideThread(const SideThread&) = delete;
  SideThread& operator=(const SideThread&) = delete;

  // Waits while too many bytes wait already. Errors: the first of the items so far; the new one is
  // then dropped.
  Status push(size_t bytes, std::function<Status()> work) EXCLUDES(mutex_);
  // Waits until all items are done. Errors: the first of the items.
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
  std::deque<Item> items_ GUARDED_BY(mutex_);  // the first is running
  size_t bytes_ GUARDED_BY(mutex_) = 0;
  bool ending_ GUARDED_BY(mutex_) = false;
  std::optional<Error> error_ GUARDED_BY(mutex_);
  std::exception_ptr thrown_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
