// A pool of threads that wait for the parts of one job. Starting threads for every tile would cost
// as much as a small tile.
#pragma once

#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "server/base/thread_annotations.h"

namespace voxeld {

// A pool. Only one thread at a time may call run().
class WorkerPool {
 public:
  // threads: includes the caller of run(); at least 1.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  // Calls body(worker) for worker 0 to count - 1 <= threads() - 1 and waits for all. Each runs on
  // its own thread, 0 on the caller's. The body must not throw.
  void run(int count, const std::function<void(int)>& body);

 private:
  void work(int worker);

  Mutex mutex_;
  CondVar changed_;
  const std::function<void(int)>* body_ GUARDED_BY(mutex_) = nullptr;
  int count_ GUARDED_BY(mutex_) = 0;
  int running_ GUARDED_BY(mutex_) = 0;
  uint64_t generation_ GUARDED_BY(mutex_) = 0;  // jobs so far
  bool stopping_ GUARDED_BY(mutex_) = false;
  std::vector<std::thread> workers_;
};

}  // namespace voxeld
