// Holds workers to their limits from outside, whatever they report or keep to themselves.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/records/job_store.h"

namespace voxeld {

struct WatchedWorker {
  int64_t pid = 0;
  std::string task;           // job id; empty: idle
  double task_seconds = 0;    // since it was given
  double silent_seconds = 0;  // since a message was expected of it
  int64_t asked_bytes = 0;    // of memory, which the task was granted; 0: none yet
  int64_t needed_bytes = 0;   // of memory, for which it asks, granted or not
  // For want of memory the job has lost a worker before. Since then it begins with what it needs.
  bool was_displaced = false;
};

struct WatchLimits {
  // Memory of one worker process, without mapped files. 0: no limit.
  int64_t memory_bytes_max = 0;
  // Memory of all worker processes together. 0: no limit.
  int64_t all_memory_bytes_max = 0;
  // Duration of one attempt at a job.
  double job_seconds_max = 0;
  // Silence of a worker with a task, which reports several times a second. 0: no limit.
  double silent_seconds_max = 0;
};

class WorkerWatch {
 public:
  static constexpr std::chrono::milliseconds kPeriod{200};

  // Each is called on the watch's thread.
  struct Calls {
    std::function<std::vector<WatchedWorker>()> workers;
    std::function<void(const WatchedWorker&, int64_t memory_bytes)> measured;
    // The worker must be ended, and its job fails with this error.
    std::function<void(const WatchedWorker&, const Error&)> condemned;
    // The worker must be ended, because all workers together exceed the limit and this one exceeds
    // its request the most. Its job is retried. The loss counts if it exceeds the limit alone, and
    // each time that it was granted memory after the first.
    std::function<void(const WatchedWorker&, const WorkerLoss& loss)> displaced;
    // The worker gives no sign of life: others have the device. Each period, until it does.
    std::function<void(const WatchedWorker&)> silent;
  };
  WorkerWatch(WatchLimits limits, Calls calls);
  ~WorkerWatch();
  WorkerWatch(const WorkerWatch&) = delete;
  WorkerWatch& operator=(const WorkerWatch&) = delete;

 private:
  void run();
  void look_at_workers() const;
  struct Measured {
    const WatchedWorker* worker;
    int64_t bytes;
  };
  // False: it has to go.
  bool look(const Measured& measured) const;
  void look_at_all(const std::vector<Measured>& all) const;

  const WatchLimits limits_;
  const Calls calls_;
  Mutex mutex_;
  CondVar wake_;
  bool ending_ GUARDED_BY(mutex_) = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
