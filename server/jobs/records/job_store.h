// Jobs in the database: every transition of JobState is one method here, durable when it returns;
// of a transient job, and a claim of any, soon after.
//
//   submit ──> queued ──claim──> running ──complete──> done
//                │ ^                │ └────fail──────> failed | cancelled (error `cancelled`)
//                │ └──lose_worker───┤                  (the third time: failed worker-crashed)
//                ├─cancel─> cancelled <──lose_worker, recover after cancel of a running job
//                └─expire─> failed (deadline-exceeded)
//
// A report on a running job carries the fence that its claim gave; one with an older fence changes
// nothing and comes back as nullopt.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/messages/job.h"
#include "proto/messages/task_api.h"
#include "server/jobs/database/database.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/records/job_queue.h"
#include "server/jobs/records/quota.h"

namespace voxeld {

// The rows that a finished task leaves; its blobs are in the store already.
struct FinishedTask {
  std::string task;
  int64_t fence = 0;
  JobResult result;
  StageTimes timings;  // of the worker
  int64_t frames = 0;  // of result.sequence
  int64_t grid_bytes = 0, sequence_bytes = 0;
  int64_t bytes_max = 0;  // that the job's tenant may keep; 0: any
  Durability durability = Durability::kNow;
};

// Facts of a running job that are not yet in the database.
struct LiveJob {
  // NOLINTNEXTLINE(google-explicit-constructor): most know the version alone
  LiveJob(int64_t version_seen = 0, int64_t device_held_us = 0)
      : version(version_seen), device_us(device_held_us) {}
  int64_t version;    // the highest that clients have seen, progress included
  int64_t device_us;  // for which this attempt has had its device
};

// How a job lost its worker.
struct WorkerLoss {
  std::string reason;
  bool counts = false;          // as an attempt: it is the job's fault, perhaps
  int64_t displaced_bytes = 0;  // that it took or needs, where all together took too much
};

// A job in the state `running`, as its claim left it.
struct RunningJob {
  std::string id;
  int64_t fence = 0;
};

// Thread-safe; holds no state of its own.
class JobStore {
 public:
  // `is_stored` tells whether a blob is in the blob store and not known to be damaged.
  // `deadline_now_ms`: the clock of deadlines, in milliseconds; it must not jump.
  JobStore(Database& database, std::function<bool(std::string_view id)> is_stored,
           std::function<int64_t()> deadline_now_ms)
      : database_(database),
        is_stored_(std::move(is_stored)),
        deadline_now_ms_(std::move(deadline_now_ms)) {}

  int64_t deadline_now_ms() const { return deadline_now_ms_(); }

  struct Submitted {
    JobRecord record;
    bool existed = false;  // the idempotency key had been used for this request
  };
  // Inserts a job: queued, or done at once when an equal one of the same tenant has a result and
  // use_cache is on. An empty filename becomes the asset's. Errors: not-found (asset, file of a
  // bundle, grid, sequence), gone, invalid-option, queue-full, too-many-requests (of the tenant's
  // own jobs wait too many, see quota.h), quota-exceeded (rows count, too),
  // idempotency-mismatch.
  Result<Submitted> submit(const Caller& caller, JobRequest request, const SubmitOptions& options,
                           const QueueLimits& limits);

  // The job that submit() would find by the request's Idempotency-Key; nullopt: it would make one.
  // Errors: idempotency-mismatch.
  Result<std::optional<JobRecord>> known(const Caller& caller, const JobRequest& request,
                                         std::string_view idempotency_key);

  // Whether submit() would answer from a result that is there. Fills in what submit() fills in.
  // Errors: those of the input.
  Result<bool> has_result(const Caller& caller, JobRequest& request);
  // The blobs of the result that submit() would answer this with; none when it would queue a job.
  // Errors as of submit().
  Result<std::vector<std::string>> reusable(const Caller& caller, JobRequest request);

  Result<JobRecord> get(const Caller& caller, std::string_view id,
                        JobTexts texts = JobTexts::kWhole);
  // Calls `take` with one job after the other until it gives false; it must be quick, since no
  // change is checkpointed meanwhile. Errors: those of `take`; invalid-option for `query.after`.
  Status list(const Caller& caller, const JobQuery& query,
              const std::function<Result<bool>(JobRecord&&)>& take);
  // State changes after `after_id`, oldest first, at most kEventsReadMax. Errors: not-found.
  static constexpr int64_t kEventsReadMax = 16;
  Result<std::vector<JobEvent>> events(const Caller& caller, std::string_view id, int64_t after_id);

  // The next job for a worker, or nullopt when none waits. A job whose result an equal one has
  // left meanwhile ends as done without a worker: it comes back with that state.
  Result<std::optional<JobRecord>> claim(std::string_view worker, const PickHead& pick = {},
                                         QueueOrder order = QueueOrder::kFair);

  // Failed with quota-exceeded or payload-too-large where the tenant may not keep the result.
  Result<std::optional<JobRecord>> complete(const FinishedTask& task, const LiveJob& live);
  Result<std::optional<JobRecord>> fail(std::string_view id, int64_t fence, const Error& error,
                                        const LiveJob& live);
  // The job's worker is gone. Queued again, or failed where that was its last attempt.
  Result<std::optional<JobRecord>> lose_worker(std::string_view id, int64_t fence,
                                               const WorkerLoss& loss, const LiveJob& live);
  // Queued again without counting the attempt, at its place in the order of arrival and with its
  // progress; cancelled where that was asked for.
  Result<std::optional<JobRecord>> preempt(const TaskPreemption& preempt, const LiveJob& live);
  struct Cancelled {
    JobRecord record;
    bool ended_now = false;  // by this call
  };
  // Idempotent. Queued: cancelled. Running: marked; its worker is told. Errors: not-found.
  Result<Cancelled> cancel(const Caller& caller, std::string_view id);
  // Removes the record of a job that has ended, with its events and its Idempotency-Key. Its result
  // stays, as its tenant lists it. Returns the blobs that may go. Errors: not-found, conflict for a
  // job that has not ended.
  Result<std::vector<std::string>> forget(const Caller& caller, std::string_view id);

  // Ends queued jobs whose deadline has passed.
  struct Expired {
    std::vector<JobRecord> ended;
    int64_t next_in_ms = 0;  // until the next deadline of those that still wait; 0: none has one
  };
  Result<Expired> expire();

  // At start, before any worker: running jobs are queued again (their attempt does not count),
  // cancelled ones and one-shot jobs, whose clients are gone, end as cancelled. Returns how many
  // jobs it touched. `stopped_ms`: for how long the clock of deadlines went on without a daemon;
  // deadlines are later by that, so that jobs have what remained.
  Result<int64_t> recover(int64_t stopped_ms);

  // That a finished voxelization of the caller left this container, or a frame, and that it was not
  // deleted since. Errors: not-found, gone.
  Status check_grid(const Caller& caller, std::string_view id);
  // That the result of this job, which is done, was not deleted since. Errors: gone.
  Status check_result(std::string_view job);
  // How many jobs wait and run: all of them, or those that the caller sees.
  Result<LiveJobs> live();
  Result<LiveJobs> live(const Caller& caller);
  Result<std::vector<RunningJob>> running();
  // The first queued job of each tenant.
  Result<std::vector<QueueHead>> queue_heads();
  Result<TenantUsage> usage(std::string_view tenant);
  // The usage that an upload of `asked` bytes has to fit beside.
  struct UploadRoom {
    int64_t used = 0;           // by the tenant
    bool can_be_there = false;  // the tenant has a blob of `asked` bytes
    int64_t longest_blob = 0;
  };
  Result<UploadRoom> upload_room(std::string_view tenant, int64_t asked);

 private:
  Database& database_;
  std::function<bool(std::string_view)> is_stored_;
  std::function<int64_t()> deadline_now_ms_;
};

}  // namespace voxeld
