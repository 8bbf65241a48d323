// How a session gives back the task of a worker that is gone.
#include <chrono>
#include <thread>
#include <utility>

#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/workers/worker_session.h"

namespace voxeld {

// A full disk, the daemon's stop, the memory that other jobs take and the end of a worker that has
// not got the task yet are not the job's fault.
WorkerLoss WorkerSession::loss_of_task(const Error& why) const {
  MutexLock lock(mutex_);
  if (!has_worker_) return {};
  WorkerLoss loss = ended_.value_or(WorkerLoss{"", /*counts=*/true});
  if (context_.stopping || why.code == ErrorCode::kStorageFull) loss.counts = false;
  return loss;
}

// How the worker was lost, for the job's error.
std::string WorkerSession::lost_reason(const Error& why, const WorkerLoss& loss) {
  std::string reason = kill_reason_.empty() ? loss.reason : kill_reason_;
  if (loss.counts && reason.empty() && why.code == ErrorCode::kDeadlineExceeded) {
    reason = "no sign of life";
    kill(pid_);  // it may not go on with this task
  } else if (loss.counts && reason.empty() && context_.config.exit_reason) {
    reason = context_.config.exit_reason(pid_);
  }
  if (!reason.empty()) return reason;
  const bool closed = why.code == ErrorCode::kGone || why.detail.empty();
  return closed ? "connection lost" : why.message();
}

// The database may be full for hours, and a job must not hang in `running` for that: this goes on
// until it succeeds or the daemon stops, after which recover() does it.
void WorkerSession::put_back(const Error& why) noexcept {
  constexpr std::chrono::milliseconds kBetweenTries{500};
  constexpr int kTriesWhileStopping = 2;
  std::string reason;
  bool is_charged = false;
  for (int tries = 0; !context_.stopping || tries < kTriesWhileStopping; ++tries) {
    bool is_done = false;
    guarded("putting a job back", [&] {
      if (const auto record = context_.dispatcher.assigned(number_)) {
        set_task(record->status.id, record->fence);
        context_.dispatcher.accept(number_);
      }
      const std::string lost_task = task();
      if (!lost_task.empty()) {
        WorkerLoss loss = loss_of_task(why);
        if (reason.empty()) reason = lost_reason(why, loss);
        loss.reason = reason;
        // First: once it is queued, another worker may claim it.
        if (loss.counts && !std::exchange(is_charged, true)) {
          context_.parts.slices.charge_lost_worker(device_, tenant_);
        }
        auto lost = end_lost(lost_task, loss);
        if (!lost) {
          log::error("cannot put a job back",
                     {{"job", lost_task}, {"error", lost.error().message()}});
          return;
        }
        is_done = true;
        const auto& job = *lost;
        if (job) end_task(*job);
        context_.dispatcher.notify_work();
      }
      is_done = true;
    });
    if (is_done) return;
    std::this_thread::sleep_for(kBetweenTries);
  }
}

// Failed, where a watch has ended the worker for what the job took; else the job is put back.
Result<std::optional<JobRecord>> WorkerSession::end_lost(const std::string& task_id,
                                                         const WorkerLoss& loss) {
  std::optional<Error> verdict;
  {
    MutexLock lock(mutex_);
    verdict = verdict_;
  }
  const LiveJob live = context_.parts.live(task_id);
  if (verdict) {
    files_.clear();  // first, since the disk may be full of what it wrote
    return context_.parts.jobs.fail(task_id, fence_, *verdict, live);
  }
  return context_.parts.jobs.lose_worker(task_id, fence_, loss, live);
}

}  // namespace voxeld
