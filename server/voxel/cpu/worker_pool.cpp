#include "server/voxel/cpu/worker_pool.h"

#include "server/base/check.h"

namespace voxeld {

WorkerPool::WorkerPool(int threads) {
  for (int worker = 1; worker < threads; ++worker) {
    workers_.emplace_back([this, worker] { work(worker); });
  }
}

WorkerPool::~WorkerPool() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : workers_) thread.join();
}

void WorkerPool::run(int count, const std::function<void(int)>& body) {
  VOXELD_CHECK(count <= threads(), "more parts than threads");
  if (count <= 1) {
    if (count == 1) body(0);
    return;
  }
  {
    const MutexLock lock(mutex_);
    body_ = &body;
    count_ = count;
    running_ = count - 1;
    ++generation_;
  }
  changed_.notify_all();
  body(0);
  MutexLock lock(mutex_);
  while (running_ > 0) changed_.wait(lock);
}

void WorkerPool::work(int worker) {
  uint64_t seen = 0;
  for (;;) {
    const std::function<void(int)>* body = nullptr;
    {
      MutexLock lock(mutex_);
      while (!stopping_ && generation_ == seen) changed_.wait(lock);
      if (stopping_) return;
      seen = generation_;
      if (worker >= count_) continue;
      body = body_;
    }
    (*body)(worker);
    const MutexLock lock(mutex_);
    if (--running_ == 0) changed_.notify_all();
  }
}

}  // namespace voxeld
