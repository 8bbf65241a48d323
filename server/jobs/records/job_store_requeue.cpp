// How a job that runs comes back into the queue.
#include <algorithm>

#include "proto/limits.h"
#include "server/base/clock.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/records/job_changes.h"
#include "server/jobs/records/job_rows.h"
#include "server/jobs/records/job_store.h"

namespace voxeld {
namespace {

// Progress is not stored, so after a crash the database does not know how far a running job's
// version had got. A queued job may have run, too: power loss undoes claims. Ten events a second
// for three years are fewer than this.
constexpr int64_t kVersionJump = 1'000'000'000;

// The stages of a job that goes back to the queue, with the wait that ended when it started. Its
// next wait begins now.
StageTimes waited_timings(const JobRecord& running) {
  StageTimes timings = running.status.timings;
  add_stage(timings, "queue", static_cast<double>(running.status.started_ms - running.queued_ms));
  return timings;
}

}  // namespace

Result<std::optional<JobRecord>> JobStore::lose_worker(std::string_view id, int64_t fence,
                                                       const WorkerLoss& loss,
                                                       const LiveJob& live) {
  std::optional<JobRecord> changed;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto running, fenced_job(connection, id, fence));
    if (!running) return {};
    std::string lost = running->lost_workers;
    if (loss.counts) lost += (lost.empty() ? "" : ", ") + loss.reason;
    if (running->cancel_requested) {
      VOXELD_TRY(end_with_error(connection, id,
                                {ErrorCode::kCancelled, "the job was cancelled", "", ""}, live));
    } else if (loss.counts && running->status.attempt >= limits::kJobAttemptsMax) {
      const Error error{
          ErrorCode::kWorkerCrashed,
          "the job ended " + std::to_string(running->status.attempt) + " workers: " + lost, "", ""};
      VOXELD_TRY(end_with_error(connection, id, error, live));
    } else {
      VOXELD_TRY(connection.run(
          "UPDATE jobs SET state = 'queued', worker = '', attempt = attempt - $2, lost_workers = "
          "$3,"
          " version = CASE WHEN version > $4 THEN version ELSE $4 END + 1,"
          " device_us = device_us + $5, displaced_bytes = $6, timings_json = $7, queued_ms = $8"
          " WHERE id = $1",
          id, int64_t{loss.counts ? 0 : 1}, lost, live.version, live.device_us,
          std::max(running->displaced_bytes, loss.displaced_bytes),
          timings_text(waited_timings(*running)), unix_time_ms()));
    }
    VOXELD_ASSIGN(changed, record_change(connection, id));
    return {};
  });
  VOXELD_TRY(committed);
  return changed;
}

Result<std::optional<JobRecord>> JobStore::preempt(const TaskPreemption& preempt,
                                                   const LiveJob& live) {
  std::optional<JobRecord> changed;
  Status committed = database_.write([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto running, fenced_job(connection, preempt.task, preempt.fence));
    if (!running) return {};
    const bool is_wanted = !running->cancel_requested;
    if (is_wanted) {
      StageTimes timings = waited_timings(*running);
      for (const auto& [stage, ms] : preempt.timings) add_stage(timings, stage, ms);
      VOXELD_TRY(connection.run(
          "UPDATE jobs SET state = 'queued', worker = '', attempt = attempt - 1,"
          " preempted = preempted + 1, tiles_done = $2, tiles_total = $3, timings_json = $4,"
          " queued_ms = $7,"
          " version = CASE WHEN version > $5 THEN version ELSE $5 END + 1,"
          " device_us = device_us + $6 WHERE id = $1",
          preempt.task, preempt.tiles_done, preempt.tiles_total, timings_text(timings),
          live.version, live.device_us, unix_time_ms()));
    } else {
      VOXELD_TRY(end_with_error(connection, preempt.task,
                                {ErrorCode::kCancelled, "the job was cancelled", "", ""}, live));
    }
    VOXELD_ASSIGN(changed, record_change(connection, preempt.task));
    changed->was_preempted = is_wanted;
    return {};
  });
  VOXELD_TRY(committed);
  return changed;
}

Result<int64_t> JobStore::recover(int64_t stopped_ms) {
  int64_t touched = 0;
  // A daemon that could not start on a full disk could not make room there either.
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(connection.run("DELETE FROM idempotency_keys WHERE created_ms <= $1",
                              unix_time_ms() - kIdempotencyKeptMs));
    VOXELD_TRY(
        connection.run("UPDATE jobs SET deadline_ms = deadline_ms + $1"
                       " WHERE state IN ('queued', 'running') AND deadline_ms <> $2",
                       stopped_ms, kNoDeadline));
    VOXELD_TRY(connection.run("UPDATE jobs SET version = version + $1 WHERE state = 'queued'",
                              kVersionJump));
    std::vector<std::string> ids;
    {
      VOXELD_ASSIGN(SqlStatement rows,
                    connection.query("SELECT id FROM jobs WHERE state = 'running'"
                                     " OR (state = 'queued' AND transient = 1) ORDER BY seq"));
      while (true) {
        VOXELD_ASSIGN(const bool row, rows.step());
        if (!row) break;
        ids.push_back(rows.text(0));
      }
    }
    for (const std::string& id : ids) {
      VOXELD_ASSIGN(const JobRecord record, load_job(connection, Caller::daemon(), id));
      const int64_t live_version = record.status.version + kVersionJump;
      if (record.cancel_requested || record.transient) {
        const Error error{ErrorCode::kCancelled,
                          record.cancel_requested
                              ? "the job was cancelled"
                              : "the daemon restarted while the client was waiting",
                          "", ""};
        VOXELD_TRY(end_with_error(connection, id, error, live_version));
      } else {
        VOXELD_TRY(
            connection.run("UPDATE jobs SET state = 'queued', worker = '', attempt = attempt - 1,"
                           " version = $2, timings_json = $3, queued_ms = $4 WHERE id = $1",
                           id, live_version, timings_text(waited_timings(record)), unix_time_ms()));
      }
      VOXELD_TRY(record_change(connection, id));
    }
    touched = static_cast<int64_t>(ids.size());
    return {};
  });
  VOXELD_TRY(committed);
  return touched;
}

}  // namespace voxeld
