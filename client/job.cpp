// Job: a submitted job as an object, and the wait for the first of several.
#include <algorithm>
#include <thread>

#include "client/client_impl.h"
#include "client/include/voxeld/client.h"
#include "proto/output_format.h"
#include "proto/text/percent_encoding.h"

namespace voxeld::client {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Between two looks at a job, if less than a second is left: HTTP's waits are whole seconds.
constexpr std::chrono::milliseconds kLookPause = 50ms;
constexpr std::chrono::milliseconds kLookPauseMax = 500ms;  // of wait_any(): pauses double
constexpr std::chrono::milliseconds kStopPause = 20ms;      // a stop is noticed after it

[[noreturn]] void stopped_by_caller() {
  throw Error("interrupted", 0, "stopped by the caller");
}

void pause_until(Clock::time_point until, const std::stop_token& stop) {
  while (Clock::now() < until) {
    if (stop.stop_requested()) stopped_by_caller();
    std::this_thread::sleep_until(std::min(until, Clock::now() + kStopPause));
  }
}

[[noreturn]] void made_none(const JobInfo& job, const char* expected) {
  throw Error("conflict", 0, "the result of the job " + job.id, expected, job.media_type);
}

}  // namespace

Job::Job(std::shared_ptr<ClientImpl> client, JobInfo info)
    : client_(std::move(client)), info_(std::move(info)) {}

bool Job::poll() {
  if (!info_.ended()) info_ = client_->look_for(percent_encode(id()), 0s, {});
  return info_.ended();
}

bool Job::wait_for(std::chrono::milliseconds time, const std::stop_token& stop) {
  const auto until = Clock::now() + time;
  while (!poll()) {
    const auto left = until - Clock::now();
    if (left <= 0s) return false;
    if (left >= 1s) {
      info_ = client_->look_for(percent_encode(id()),
                                std::chrono::duration_cast<std::chrono::seconds>(left), stop);
    } else {
      pause_until(std::min(until, Clock::now() + kLookPause), stop);
    }
  }
  return true;
}

const JobInfo& Job::wait(const ProgressCallback& progress, const std::stop_token& stop) {
  if (!info_.ended()) info_ = client_->wait_end(percent_encode(id()), progress, stop);
  check_done(info_);
  return info_;
}

void Job::cancel() {
  if (!info_.ended()) info_ = client_->cancel(percent_encode(id()));
}

void Job::download(const Sink& sink, const ProgressCallback& progress,
                   const std::stop_token& stop) {
  wait(progress, stop);
  client_->download(percent_encode(id()), sink, progress, stop);
}

Grid Job::grid(const ProgressCallback& progress, const std::stop_token& stop) {
  wait(progress, stop);
  if (info_.media_type != format_media_type(voxeld::Format::kNative)) {
    if (info_.grid.empty()) made_none(info_, "a grid");
    return client_->grid(info_.grid, progress, stop);
  }
  std::vector<std::byte> container;
  download(appends_to(container), progress, stop);
  return client_->stored_grid(container, info_.grid);
}

Sequence Job::sequence(const ProgressCallback& progress, const std::stop_token& stop) {
  wait(progress, stop);
  std::vector<std::byte> container;
  if (info_.media_type == sequence_media_type(voxeld::Format::kNative)) {
    download(appends_to(container), progress, stop);
  } else {
    if (info_.sequence.empty()) made_none(info_, "a sequence");
    client_->fetch("/v1/sequences/" + percent_encode(info_.sequence),
                   "the sequence " + info_.sequence, appends_to(container), progress, stop);
  }
  return Sequence::decode(std::move(container));
}

std::optional<std::size_t> wait_any(std::span<Job> jobs,
                                    std::optional<std::chrono::milliseconds> time,
                                    const std::stop_token& stop) {
  if (jobs.empty()) return std::nullopt;
  const auto begin = Clock::now();
  for (auto pause = kLookPause;; pause = std::min(2 * pause, kLookPauseMax)) {
    for (size_t i = 0; i < jobs.size(); ++i) {
      if (jobs[i].poll()) return i;
      if (stop.stop_requested()) stopped_by_caller();
    }
    const auto now = Clock::now();
    if (time && now - begin >= *time) return std::nullopt;
    const auto next = now + pause;
    pause_until(time ? std::min<Clock::time_point>(next, begin + *time) : next, stop);
  }
}

}  // namespace voxeld::client
