// Waits that block, for tests: the service itself has none.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include "server/jobs/service/job_service.h"
#include "tests/unit/base/comes_true.h"

namespace voxeld::testing {

// Blocks a thread until it is woken.
class BlockingWaker final : public Waker {
 public:
  void wake() override {
    const std::lock_guard lock(mutex_);
    is_woken_ = true;
    woken_.notify_all();
  }
  // Returns when wake() was called since the last wait, or at the deadline.
  void wait(JobService::Clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    woken_.wait_until(lock, deadline, [this] { return is_woken_; });
    is_woken_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable woken_;
  bool is_woken_ = false;
};

// The job's status when `is_over` is true of it, when it has ended, or at the deadline.
inline Result<JobStatus> wait_until(JobService& service, const Caller& caller, std::string_view id,
                                    JobService::Clock::time_point deadline,
                                    const std::function<bool(const JobStatus&)>& is_over) {
  const auto waker = std::make_shared<BlockingWaker>();
  const auto watch = service.watch(id, JobChange::kAny, waker);
  while (true) {
    auto status = service.get(caller, id);
    if (!status || status->ended() || is_over(*status)) return status;
    if (JobService::Clock::now() >= deadline) return status;
    waker->wait(deadline);
  }
}

inline Result<JobStatus> wait_end(JobService& service, const Caller& caller, std::string_view id,
                                  std::chrono::seconds patience = kPatience) {
  return wait_until(service, caller, id, JobService::Clock::now() + patience,
                    [](const JobStatus&) { return false; });
}

inline Result<JobStatus> wait_change(JobService& service, const Caller& caller, std::string_view id,
                                     int64_t after_version,
                                     JobService::Clock::time_point deadline) {
  return wait_until(service, caller, id, deadline,
                    [&](const JobStatus& status) { return status.version > after_version; });
}

// The events after `after_id` when there are any, or none at the deadline.
inline Result<std::vector<JobEvent>> wait_events(JobService& service, const Caller& caller,
                                                 std::string_view id, int64_t after_id,
                                                 JobService::Clock::time_point deadline) {
  const auto waker = std::make_shared<BlockingWaker>();
  const auto watch = service.watch(id, JobChange::kAny, waker);
  while (true) {
    auto events = service.events(caller, id, after_id);
    if (!events || !events->empty() || JobService::Clock::now() >= deadline) return events;
    waker->wait(deadline);
  }
}

}  // namespace voxeld::testing
