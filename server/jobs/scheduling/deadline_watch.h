// Ends queued jobs when their deadline passes, and not when it would be their turn.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "server/base/thread_annotations.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/records/job_store.h"

namespace voxeld {

// Thread-safe. A thread of its own sleeps until the next deadline. Running jobs are their workers'.
class DeadlineWatch {
 public:
  // `ended` is called after each job's end is durable.
  DeadlineWatch(JobStore& jobs, std::function<void(const JobRecord&)> ended);
  ~DeadlineWatch();
  // Returns when its thread has ended.
  void stop() EXCLUDES(mutex_);
  DeadlineWatch(const DeadlineWatch&) = delete;
  DeadlineWatch& operator=(const DeadlineWatch&) = delete;
  // A job was queued, whose deadline may be the next.
  void look() EXCLUDES(mutex_);

 private:
  void run() EXCLUDES(mutex_);
  // How long to sleep until the next look.
  std::chrono::milliseconds end_expired();

  JobStore& jobs_;
  const std::function<void(const JobRecord&)> ended_;
  Mutex mutex_;
  CondVar changed_;
  bool ending_ GUARDED_BY(mutex_) = false;
  bool looks_ GUARDED_BY(mutex_) = true;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
