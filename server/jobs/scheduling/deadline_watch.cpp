#include "server/jobs/scheduling/deadline_watch.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/model/job_record.h"

namespace voxeld {
namespace {

// The longest sleep: a suspend of the machine, and jobs that were put back, are noticed after it.
constexpr std::chrono::milliseconds kSleepMax{1000};

}  // namespace

DeadlineWatch::DeadlineWatch(JobStore& jobs, std::function<void(const JobRecord&)> ended)
    : jobs_(jobs), ended_(std::move(ended)) {
  thread_ = std::thread([this] { run(); });
}

DeadlineWatch::~DeadlineWatch() {
  stop();
}

void DeadlineWatch::stop() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void DeadlineWatch::look() {
  MutexLock lock(mutex_);
  looks_ = true;
  changed_.notify_all();
}

void DeadlineWatch::run() {
  std::chrono::milliseconds sleep{0};
  while (true) {
    {
      const auto until = std::chrono::steady_clock::now() + sleep;
      MutexLock lock(mutex_);
      while (!ending_ && !looks_) {
        if (changed_.wait_until(lock, until) == std::cv_status::timeout) break;
      }
      if (ending_) return;
      looks_ = false;
    }
    sleep = kSleepMax;
    guarded("the watch of deadlines", [&] { sleep = end_expired(); });
  }
}

std::chrono::milliseconds DeadlineWatch::end_expired() {
  const auto expired = jobs_.expire();
  if (!expired) {
    log::error("cannot look for deadlines", {{"error", expired.error().message()}});
    return kSleepMax;
  }
  for (const JobRecord& record : expired->ended) ended_(record);
  if (expired->next_in_ms == 0) return kSleepMax;
  return std::clamp(std::chrono::milliseconds(expired->next_in_ms), std::chrono::milliseconds(1),
                    kSleepMax);
}

}  // namespace voxeld
