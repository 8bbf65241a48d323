// When the jobs that live now will start and end.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/messages/job.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/estimates/forecast.h"
#include "server/jobs/estimates/job_costs.h"
#include "server/jobs/model/job_record.h"

namespace voxeld {

// Knows the jobs that are queued or running, by what the service tells of them. Thread-safe.
class QueueForecast {
 public:
  using Weight = std::function<double(const std::string& tenant)>;
  // `overlay` adds a running job's progress to its status.
  QueueForecast(JobCosts& costs, int devices, Weight weight,
                std::function<void(JobStatus&)> overlay)
      : costs_(costs),
        devices_(devices),
        weight_(std::move(weight)),
        overlay_(std::move(overlay)) {}

  // A job was submitted.
  void add(const JobRecord& record, const JobInput& input) EXCLUDES(mutex_);
  // One of these was claimed, put back or ended. What is told late, of a job that has ended or has
  // changed again, is left out.
  void changed(const JobRecord& record) EXCLUDES(mutex_);
  // Adds estimate and expected times to the status, with device time, of a job that has not ended.
  void fill(JobStatus& status) EXCLUDES(mutex_);
  // That a job is expected to take from now on; 0 of one that is not known.
  double expected_seconds(std::string_view id) EXCLUDES(mutex_);
  // The cost of a job, and when it would start and end if submitted now: a status without id.
  JobStatus estimate(const std::string& tenant, const JobRequest& request, const JobInput& input)
      EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  // Forecasts are made at most so often while nothing changes.
  static constexpr std::chrono::milliseconds kKept{250};
  // A forecast takes time with each live job. Up to so many, each change is followed by a new one;
  // above, forecasts take no more than a part of all time, and until the next one is made, a new
  // job has no expected times.
  static constexpr size_t kFewJobs = 256;
  static constexpr int kRestFactor = 20;

  struct Live {
    std::string tenant;
    int64_t seq = 0, deadline_ms = kNoDeadline;
    bool is_running = false;
    JobWork work;
    JobEstimate estimate;
    JobStatus status;       // as it was told last
    double share_kept = 0;  // of the work, that was done when it was queued or started last
  };
  struct Expected {
    int64_t start_ms = 0, end_ms = 0;
  };
  void set_status(Live& live, const JobRecord& record) REQUIRES(mutex_);
  double seconds_left(const Live& live, int64_t now_ms);
  std::vector<std::pair<std::string, ForecastJob>> queue() REQUIRES(mutex_);
  void refresh() REQUIRES(mutex_);

  JobCosts& costs_;
  const int devices_;
  const Weight weight_;
  const std::function<void(JobStatus&)> overlay_;
  Mutex mutex_;
  std::map<std::string, Live, std::less<>> live_ GUARDED_BY(mutex_);
  std::map<std::string, Expected, std::less<>> expected_ GUARDED_BY(mutex_);
  Clock::time_point refreshed_ GUARDED_BY(mutex_){};
  Clock::time_point rests_until_ GUARDED_BY(mutex_){};
};

}  // namespace voxeld
