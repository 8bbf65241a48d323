// Work beside the thread that runs a task, in order.
#pragma once

#include <functional>
#include <memory>

#include "proto/result.h"

namespace voxeld {

// Runs items one after another, in order, on threads of the process's pool (proto/thread_pool.h).
// After an error it runs no more. One thread makes the queue and pushes items; their exceptions are
// rethrown there, and they run within the CancelScope in which it made the queue.
// That thread runs items itself where it would only wait for them, so a queue comes to its end
// however busy the pool is.
class SerialQueue {
 public:
  // bytes_max: limit of the waiting items' bytes, as push() is told. A single larger item does not
  // wait.
  explicit SerialQueue(size_t bytes_max);
  // Drops the items that still wait.
  ~SerialQueue();
  SerialQueue(const SerialQueue&) = delete;
  SerialQueue& operator=(const SerialQueue&) = delete;

  // Waits while too many bytes wait already. Errors: the first of the items so far; the new one is
  // then dropped.
  Status push(size_t bytes, std::function<Status()> work);
  // Waits until all items are done. Errors: the first of the items.
  Status wait();

 private:
  struct State;
  const std::shared_ptr<State> state_;  // the pool's: it may look at it after the queue's end
};

}  // namespace voxeld
