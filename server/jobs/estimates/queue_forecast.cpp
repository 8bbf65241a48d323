#include "server/jobs/estimates/queue_forecast.h"
#include "server/base/clock.h"
#include "server/jobs/model/job_record.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>

namespace voxeld {
namespace {

// A job that takes longer than was expected is expected to take a little longer still.
constexpr double kLateShare = 0.1;
// Before so much of the work is done, the rate of the tiles says less than other jobs do.
constexpr double kShareKnown = 0.05;

RequestOptions options_of(const JobStatus& status) {
  JobRequest request;
  request.kind = status.kind;
  request.asset = status.asset;
  request.grid = status.grid;
  request.sequence = status.sequence;
  const auto object = nlohmann::json::parse(status.options_json, nullptr, false);
  if (!object.is_object()) return {};
  const auto options = parse_options(object, option_scope(request));
  return options ? *options : RequestOptions{};
}

// The part of the work that is done, by frames and tiles; 0 where nothing tells.
double share_done(const JobStatus& status) {
  const auto share = [](int64_t done, int64_t total) {
    return total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 0.0;
  };
  const double tiles = share(status.tiles_done, status.tiles_total);
  if (status.frames_total == 0) return tiles;
  return std::min(1.0, share(status.frames_done, status.frames_total) +
                           tiles / static_cast<double>(status.frames_total));
}

// 0: no more than four of five jobs need.
double overrun(const JobEstimate& estimate, double device_seconds) {
  const double factor = device_seconds / std::max(estimate.device_seconds, 1e-3);
  return factor > estimate.seconds_high / estimate.seconds ? factor : 0;
}

}  // namespace

void QueueForecast::add(const JobRecord& record, const JobInput& input) {
  const JobStatus& status = record.status;
  const MutexLock lock(mutex_);
  Live& live = live_[status.id];
  live.tenant = record.tenant;
  live.seq = record.seq;
  live.work = work_of(status.kind, options_of(status), input);
  live.estimate = costs_.estimate(live.work);
  set_status(live, record);
}

void QueueForecast::changed(const JobRecord& record) {
  const JobStatus& status = record.status;
  const MutexLock lock(mutex_);
  const auto found = live_.find(status.id);
  if (found == live_.end()) return;
  if (status.ended()) {
    refreshed_ = {};
    if (status.state != JobState::kDone) {
      costs_.learn_at_least(found->second.work, status.device_ms / 1000);
    } else if (!status.cached) {
      costs_.learn(found->second.work, status);
    }
    live_.erase(found);
  } else if (status.version >= found->second.status.version) {
    set_status(found->second, record);
  }
}

void QueueForecast::set_status(Live& live, const JobRecord& record) {
  const JobStatus& status = record.status;
  refreshed_ = {};
  live.deadline_ms = record.deadline_ms;
  live.is_running = status.state == JobState::kRunning;
  live.status = status;
  // Up to 100 KB of a job, and nothing reads them again.
  std::string().swap(live.status.options_json);
  live.share_kept = share_done(status);
}

double QueueForecast::seconds_left(const Live& live, int64_t now_ms) {
  const double expected = live.estimate.seconds * (1 - live.share_kept);
  if (!live.is_running) return expected;
  JobStatus status = live.status;
  overlay_(status);
  const double elapsed = static_cast<double>(now_ms - status.started_ms) / 1000.0;
  const double done = share_done(status);
  const double since = done - live.share_kept;
  if (since > kShareKnown) return std::max(0.0, elapsed * (1 - done) / since);
  return std::max(expected - elapsed, kLateShare * elapsed);
}

// In the order in which each tenant's jobs are taken.
std::vector<std::pair<std::string, ForecastJob>> QueueForecast::queue() {
  const int64_t now_ms = unix_time_ms();
  std::vector<const Live*> order;
  for (const auto& [id, live] : live_) order.push_back(&live);
  const auto place = [](const Live* live) {
    return std::tuple(-live->status.priority, live->deadline_ms, live->seq);
  };
  std::sort(order.begin(), order.end(),
            [&](const Live* a, const Live* b) { return place(a) < place(b); });
  std::vector<std::pair<std::string, ForecastJob>> queue;
  queue.reserve(order.size());
  for (const Live* live : order) {
    queue.emplace_back(live->status.id, ForecastJob{live->tenant, weight_(live->tenant),
                                                    seconds_left(*live, now_ms), live->is_running});
  }
  return queue;
}

double QueueForecast::expected_seconds(std::string_view id) {
  const MutexLock lock(mutex_);
  const auto live = live_.find(id);
  return live == live_.end() ? 0 : seconds_left(live->second, unix_time_ms());
}

void QueueForecast::refresh() {
  const auto now = Clock::now();
  if (refreshed_ != Clock::time_point() && now - refreshed_ < kKept) return;
  if (live_.size() > kFewJobs && now < rests_until_) return;
  refreshed_ = now;
  const auto jobs = queue();
  std::vector<ForecastJob> played;
  played.reserve(jobs.size());
  for (const auto& [id, job] : jobs) played.push_back(job);
  const std::vector<ForecastTimes> times = forecast(played, devices_);
  const int64_t now_ms = unix_time_ms();
  expected_.clear();
  for (size_t i = 0; i < jobs.size(); ++i) {
    expected_[jobs[i].first] = {now_ms + std::llround(times[i].start * 1000),
                                now_ms + std::llround(times[i].end * 1000)};
  }
  const auto done = Clock::now();
  rests_until_ = done + kRestFactor * (done - now);
}

void QueueForecast::fill(JobStatus& status) {
  if (status.ended()) return;
  const MutexLock lock(mutex_);
  const auto live = live_.find(status.id);
  if (live == live_.end()) return;
  refresh();
  const Expected& expected = expected_[status.id];
  status.estimate = live->second.estimate;
  if (status.state == JobState::kRunning) {
    status.estimate->overrun = overrun(live->second.estimate, status.device_ms / 1000);
  }
  status.expected_start_ms =
      status.state == JobState::kRunning ? status.started_ms : expected.start_ms;
  status.expected_end_ms = expected.end_ms;
}

JobStatus QueueForecast::estimate(const std::string& tenant, const JobRequest& request,
                                  const JobInput& input) {
  const JobEstimate estimate = costs_.estimate(work_of(request.kind, request.options, input));
  std::vector<ForecastJob> jobs;
  {
    const MutexLock lock(mutex_);
    for (auto& [id, job] : queue()) jobs.push_back(std::move(job));
  }
  // Without the lock, for which every change of a job would wait.
  jobs.push_back({tenant, weight_(tenant), estimate.seconds, false});
  const ForecastTimes times = forecast(jobs, devices_).back();
  const int64_t now_ms = unix_time_ms();
  JobStatus estimated;
  estimated.kind = request.kind;
  estimated.estimate = estimate;
  estimated.queue_position = static_cast<int64_t>(jobs.size());
  estimated.expected_start_ms = now_ms + std::llround(times.start * 1000);
  estimated.expected_end_ms = now_ms + std::llround(times.end * 1000);
  return estimated;
}

}  // namespace voxeld
