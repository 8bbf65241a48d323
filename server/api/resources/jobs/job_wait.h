// Responses that wait for a job, without a thread.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/api/resources/api.h"

namespace voxeld::api {

// A one-shot request waits this long for its job; then it becomes deadline-exceeded.
inline constexpr int kOneShotSecondsMax = 3600;

using WaitPlace = std::unique_ptr<WaitLimit::Place>;

struct JobWaitPlan {
  std::string job;
  WaitPlace place;
  Clock::time_point deadline = Clock::now() + std::chrono::seconds(kOneShotSecondsMax);
  JobChange change = JobChange::kState;
  // The job is cancelled if its client leaves, the key of the request ends or the deadline passes.
  bool is_transient = false;
  // The wait ends when the server drains.
  bool is_poll = false;
  // Whether the wait is over; null: when the job has ended.
  std::function<bool(const JobStatus&)> is_over = nullptr;
  // Makes the response, also of a job that is not over when the time is.
  std::function<Response(Request&, const JobStatus&)> then;
};

// Waits as planned. The response is a problem if the job is gone (not-found) or the key of the
// request has ended (unauthorized).
Reply wait_for_job(Request& request, Api& api, JobWaitPlan plan);

// Submits a job that is cancelled when its client leaves, waits for its end and responds with
// `then`, or with the problem that it ended with; jobs that do not end in time are
// deadline-exceeded.
Reply run_transient(Request& request, Api& api, const JobRequest& job,
                    std::function<Response(Request&, const JobStatus&)> then);
// The same for a request that has its place already, and whose body took `upload_ms`.
Reply run_transient(Request& request, Api& api, const JobRequest& job, WaitPlace place,
                    double upload_ms, std::function<Response(Request&, const JobStatus&)> then);

}  // namespace voxeld::api
