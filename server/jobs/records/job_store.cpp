#include "server/jobs/records/job_store.h"

#include <array>
#include <nlohmann/json.hpp>

#include "proto/asset_id.h"
#include "proto/limits.h"
#include "proto/messages/job.h"
#include "proto/text/client_texts.h"
#include "server/base/check.h"
#include "server/base/clock.h"
#include "server/base/random.h"
#include "server/jobs/model/assets.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/request_hash.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/expiry.h"
#include "server/jobs/records/job_changes.h"
#include "server/jobs/records/job_queue.h"
#include "server/jobs/records/job_rows.h"
#include "server/jobs/records/quota.h"
#include "server/jobs/records/visibility.h"

namespace voxeld {
namespace {

// "j-" and 32 hex digits of the kernel's generator: ids cannot be guessed.
std::string new_job_id() {
  return "j-" + random_hex(32);
}

// The asset must be there; its name is the request's where the client gave none. From here on the
// request has the id of its bytes. Returns whose it is.
Result<std::string> check_asset(SqlConnection& connection, const Caller& caller,
                                JobRequest& request) {
  VOXELD_ASSIGN(Asset asset, load_asset(connection, caller, request.asset));
  if (request.filename.empty()) request.filename = std::move(asset.filename);
  request.asset = AssetId::parse(request.asset).blob;
  VOXELD_TRY(check_bundle(connection, asset.tenant, request.asset));
  return std::move(asset.tenant);
}

using IsStored = std::function<bool(std::string_view)>;

// The error for a blob that a row names and the store does not have.
Error not_stored(std::string_view what, std::string_view id) {
  return {ErrorCode::kGone,
          "the " + std::string(what) + " " + std::string(id) +
              " is not stored any more, or is damaged; submit the job that made it again",
          "", ""};
}

Status check_grid(SqlConnection& connection, const Caller& caller, std::string_view id,
                  const IsStored& is_stored) {
  VOXELD_TRY(check_stored_grid(connection, caller, id));
  return is_stored(id) ? Status() : not_stored("grid", id);
}

Status check_sequence(SqlConnection& connection, const Caller& caller, std::string_view id,
                      const IsStored& is_stored) {
  VOXELD_TRY(check_stored_sequence(connection, caller, id));
  return is_stored(id) ? Status() : not_stored("sequence", id);
}

// The input is there. Returns whose it is. A grid or a sequence may have several owners: nobody's
// where the caller is none of them, but an admin.
Result<std::string> check_input(SqlConnection& connection, const Caller& caller,
                                JobRequest& request, const IsStored& is_stored) {
  if (!request.grid.empty()) {
    VOXELD_TRY(check_grid(connection, caller, request.grid, is_stored));
  }
  if (!request.sequence.empty()) {
    VOXELD_TRY(check_sequence(connection, caller, request.sequence, is_stored));
  }
  if (!request.asset.empty()) return check_asset(connection, caller, request);
  const Caller owner = Caller::tenant(caller.tenant(), false);
  const Status own = !request.grid.empty()
                         ? check_stored_grid(connection, owner, request.grid)
                         : check_stored_sequence(connection, owner, request.sequence);
  return own ? caller.tenant() : Caller::nobody().tenant();
}

// The job that used this key within a day; none where its row went since.
Result<std::optional<JobRecord>> job_of_key(SqlConnection& connection, const Caller& caller,
                                            std::string_view key, std::string_view hash) {
  VOXELD_ASSIGN(SqlStatement found,
                connection.query("SELECT request_hash, job_id FROM idempotency_keys"
                                 " WHERE tenant = $1 AND idempotency_key = $2 AND created_ms > $3"
                                 " AND EXISTS (SELECT 1 FROM jobs WHERE id = job_id)",
                                 caller.tenant(), key, unix_time_ms() - kIdempotencyKeptMs));
  VOXELD_ASSIGN(const bool row, found.step());
  if (!row) return std::optional<JobRecord>();
  if (found.text(0) != hash) {
    return Error{ErrorCode::kIdempotencyMismatch,
                 "this Idempotency-Key was used for another request", "", ""};
  }
  VOXELD_ASSIGN(JobRecord record, load_job(connection, caller, found.text(1)));
  return std::optional(std::move(record));
}

Status remember_key(SqlConnection& connection, std::string_view tenant, std::string_view key,
                    std::string_view hash, std::string_view id, int64_t now_ms) {
  return connection.run(
      "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job_id, created_ms)"
      " VALUES ($1, $2, $3, $4, $5) ON CONFLICT (tenant, idempotency_key) DO UPDATE SET"
      " request_hash = excluded.request_hash, job_id = excluded.job_id,"
      " created_ms = excluded.created_ms",
      tenant, key, hash, id, now_ms);
}

// Whether the container of every frame that the job listed is there.
Result<bool> frames_stored(SqlConnection& connection, std::string_view job,
                           const IsStored& is_stored) {
  VOXELD_ASSIGN(SqlStatement rows,
                connection.query("SELECT DISTINCT grid FROM frames WHERE job_id = $1", job));
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return true;
    if (!is_stored(rows.text(0))) return false;
  }
}

// The newest result of the tenant's equal work whose bytes are all there; 0 when there is none.
// Results of other tenants do not count: a response without a wait would reveal them.
Result<int64_t> cached_result(SqlConnection& connection, std::string_view tenant,
                              std::string_view hash, const IsStored& is_stored) {
  VOXELD_ASSIGN(SqlStatement found,
                connection.query("SELECT seq, blob, grid, sequence, job_id FROM results"
                                 " WHERE request_hash = $1 AND tenant = $2 AND expired_ms = 0"
                                 " ORDER BY seq DESC LIMIT 1",
                                 hash, tenant));
  VOXELD_ASSIGN(const bool row, found.step());
  if (!row) return int64_t{0};
  for (const std::string& blob : {found.text(1), found.text(2), found.text(3)}) {
    if (!blob.empty() && !is_stored(blob)) return int64_t{0};
  }
  if (found.text(3).empty()) return found.int64(0);
  VOXELD_ASSIGN(const bool stored, frames_stored(connection, found.text(4), is_stored));
  return stored ? found.int64(0) : int64_t{0};
}

Status end_with_cached(SqlConnection& connection, std::string_view id, int64_t result_seq,
                       int64_t now_ms) {
  VOXELD_TRY(connection.run("UPDATE results SET used_ms = $2 WHERE seq = $1", result_seq, now_ms));
  return connection.run(
      "UPDATE jobs SET state = 'done', cached = 1, result_seq = $2, ended_ms = $3 WHERE id = $1",
      id, result_seq, now_ms);
}

// A job's asset, and the files of a bundle, are used now.
Status touch_asset(SqlConnection& connection, std::string_view tenant, std::string_view id,
                   int64_t now_ms) {
  VOXELD_TRY(connection.run("UPDATE assets SET used_ms = $3 WHERE id = $1 AND tenant = $2", id,
                            tenant, now_ms));
  return connection.run(
      "UPDATE assets SET used_ms = $3 WHERE tenant = $2 AND id IN"
      " (SELECT asset FROM bundle_files WHERE bundle = $1 AND tenant = $2)",
      id, tenant, now_ms);
}

// A row of `jobs` to be.
struct NewJob {
  const JobRequest& request;
  const SubmitOptions& options;
  std::string_view id, hash, tenant, asset_tenant;
  std::string_view options_json;  // canonical
  int64_t deadline_ms = kNoDeadline;
};

Status insert_job(SqlConnection& connection, const NewJob& job, int64_t now_ms) {
  const auto flag = [](bool value) { return int64_t{value ? 1 : 0}; };
  const JobRequest& request = job.request;
  return connection.run(
      "INSERT INTO jobs (id, kind, state, asset, grid, filename, options_json, request_hash,"
      " use_cache, transient, upload_us, created_ms, sequence, tenant, asset_tenant, priority,"
      " deadline_ms, request_id, trace_id, deadline_at_ms)"
      " VALUES ($1, $2, 'queued', $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, "
      "$17,"
      " $18, $19)",
      job.id, job_kind_name(request.kind), request.asset, request.grid, request.filename,
      job.options_json, job.hash, flag(request.options.use_cache), flag(job.options.transient),
      static_cast<int64_t>(job.options.upload_ms * 1000.0), now_ms, request.sequence, job.tenant,
      job.asset_tenant,
      int64_t{request.priority.value_or(job.options.transient ? limits::kOneShotPriority : 0)},
      job.deadline_ms, job.options.request_id, job.options.trace_id,
      request.deadline_ms ? now_ms + *request.deadline_ms : 0);
}

// queue, upload, then what workers measured: those of attempts that were preempted, and the last
// one.
StageTimes all_timings(const JobRecord& record, const StageTimes& of_worker) {
  StageTimes timings;
  timings.emplace_back("queue", static_cast<double>(record.status.started_ms - record.queued_ms));
  if (record.upload_ms > 0) timings.emplace_back("upload", record.upload_ms);
  for (const auto& [stage, ms] : record.status.timings) add_stage(timings, stage, ms);
  for (const auto& [stage, ms] : of_worker) add_stage(timings, stage, ms);
  return timings;
}

// The queued job whose deadline is next; deadline_ms 0: none has one.
struct Due {
  std::string id;
  int64_t deadline_ms = 0;
};
Result<Due> next_due(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement row,
                connection.query("SELECT id, deadline_ms FROM jobs WHERE state = 'queued'"
                                 " ORDER BY deadline_ms LIMIT 1"));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found || row.int64(1) == kNoDeadline) return Due();
  return Due{row.text(0), row.int64(1)};
}

Result<int64_t> insert_result(SqlConnection& connection, const JobRecord& job,
                              const FinishedTask& task) {
  const JobResult& result = task.result;
  VOXELD_ASSIGN(
      SqlStatement inserted,
      connection.query("INSERT INTO results (request_hash, blob, bytes, media_type,"
                       " filename, grid, meta_json, warnings_json, created_ms,"
                       " sequence, frames, job_id, tenant, grid_bytes, sequence_bytes, used_ms)"
                       " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13,"
                       " $14, $15, $9)"
                       " RETURNING seq",
                       job.request_hash, result.blob, result.bytes, result.media_type,
                       result.filename, result.grid, result.meta_json,
                       warnings_text(result.warnings), unix_time_ms(), result.sequence, task.frames,
                       task.task, job.tenant, task.grid_bytes, task.sequence_bytes));
  VOXELD_TRY(inserted.step());
  return inserted.int64(0);
}

// The description is the asset's where the job read it as the asset's name says.
Status describe_asset(SqlConnection& connection, const JobRecord& job,
                      std::string_view description_json) {
  VOXELD_ASSIGN(SqlStatement asset,
                connection.query("SELECT filename FROM assets WHERE id = $1 AND tenant = $2",
                                 job.status.asset, job.asset_tenant));
  VOXELD_ASSIGN(const bool found, asset.step());
  if (!found || reading_of(asset.text(0)) != reading_of(job.status.filename)) return {};
  return connection.run("UPDATE assets SET description_json = $3 WHERE id = $1 AND tenant = $2",
                        job.status.asset, job.asset_tenant, description_json);
}

Status end_with_result(SqlConnection& connection, const JobRecord& running,
                       const FinishedTask& task, int64_t result_seq, const LiveJob& live) {
  VOXELD_TRY(connection.run(
      "UPDATE jobs SET state = 'done', result_seq = $2, ended_ms = $3, timings_json = $4,"
      " version = CASE WHEN version > $5 THEN version ELSE $5 END + 1,"
      " device_us = device_us + $6 WHERE id = $1",
      task.task, result_seq, unix_time_ms(), timings_text(all_timings(running, task.timings)),
      live.version, live.device_us));
  if (running.status.kind != JobKind::kInspect) return {};
  return describe_asset(connection, running, task.result.meta_json);
}

}  // namespace

Result<JobStore::Submitted> JobStore::submit(const Caller& caller, JobRequest request,
                                             const SubmitOptions& options,
                                             const QueueLimits& limits) {
  VOXELD_TRY(check_frame_options(request));
  VOXELD_TRY(check_texts(request));
  VOXELD_TRY(check_urgency(request));
  VOXELD_TRY(check_length(client_texts::kIdempotencyKey, options.idempotency_key));
  const std::string id = new_job_id();
  const std::string options_json = canonical_json(request.options, option_scope(request));
  const std::string& tenant = caller.tenant();
  std::optional<Submitted> submitted;
  const auto insert = [&](SqlConnection& connection) -> Status {
    const int64_t now = unix_time_ms();
    const std::string key_hash = idempotency_hash(request);  // before the name is filled in
    if (!options.idempotency_key.empty()) {
      VOXELD_ASSIGN(auto earlier,
                    job_of_key(connection, caller, options.idempotency_key, key_hash));
      if (earlier) {
        submitted = Submitted{*std::move(earlier), true};
        return {};
      }
    }
    VOXELD_ASSIGN(const std::string asset_tenant,
                  check_input(connection, caller, request, is_stored_));
    if (!request.asset.empty()) {
      VOXELD_TRY(touch_asset(connection, asset_tenant, request.asset, now));
    }
    const std::string hash = request_hash(request);
    int64_t cached = 0;
    if (request.options.use_cache) {
      VOXELD_ASSIGN(cached, cached_result(connection, tenant, hash, is_stored_));
    }
    if (cached == 0) {
      VOXELD_TRY(check_queue(connection, tenant, limits));
    }
    VOXELD_ASSIGN(const int64_t used, used_bytes(connection, tenant));
    VOXELD_TRY(
        insert_job(connection,
                   {request, options, id, hash, tenant, asset_tenant, options_json,
                    request.deadline_ms ? deadline_now_ms() + *request.deadline_ms : kNoDeadline},
                   now));
    if (cached != 0) VOXELD_TRY(end_with_cached(connection, id, cached, now));
    if (!options.idempotency_key.empty()) {
      VOXELD_TRY(remember_key(connection, tenant, options.idempotency_key, key_hash, id, now));
    }
    VOXELD_ASSIGN(JobRecord record, record_change(connection, id));
    submitted = Submitted{std::move(record), false};
    VOXELD_TRY(check_growth(connection, tenant, used, limits.bytes_max));
    return check_records(connection, tenant, limits.record_bytes_max);
  };
  VOXELD_TRY(database_.write(insert, options.transient ? Durability::kSoon : Durability::kNow));
  return *std::move(submitted);
}

Result<std::optional<JobRecord>> JobStore::known(const Caller& caller, const JobRequest& request,
                                                 std::string_view idempotency_key) {
  if (idempotency_key.empty()) return std::optional<JobRecord>();
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return job_of_key(*reader, caller, idempotency_key, idempotency_hash(request));
}

Result<bool> JobStore::has_result(const Caller& caller, JobRequest& request) {
  VOXELD_TRY(check_frame_options(request));
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_TRY(check_input(*reader, caller, request, is_stored_));
  if (!request.options.use_cache) return false;
  VOXELD_ASSIGN(const int64_t cached,
                cached_result(*reader, caller.tenant(), request_hash(request), is_stored_));
  return cached != 0;
}

Result<std::vector<std::string>> JobStore::reusable(const Caller& caller, JobRequest request) {
  std::vector<std::string> ids;
  if (!request.options.use_cache) return ids;
  VOXELD_TRY(check_frame_options(request));
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_TRY(check_input(*reader, caller, request, is_stored_));
  VOXELD_ASSIGN(const int64_t cached,
                cached_result(*reader, caller.tenant(), request_hash(request), is_stored_));
  if (cached == 0) return ids;
  VOXELD_ASSIGN(SqlStatement rows,
                reader->query("SELECT blob FROM results WHERE seq = $1"
                              " UNION SELECT grid FROM results WHERE seq = $1 AND grid <> ''"
                              " UNION SELECT sequence FROM results WHERE seq = $1"
                              "       AND sequence <> ''"
                              " UNION SELECT f.grid FROM results r JOIN frames f"
                              "       ON f.job_id = r.job_id WHERE r.seq = $1"
                              "       AND r.sequence <> ''",
                              cached));
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return ids;
    ids.push_back(rows.text(0));
  }
}

Result<std::optional<JobRecord>> JobStore::claim(std::string_view worker, const PickHead& pick,
                                                 QueueOrder order) {
  std::optional<JobRecord> claimed;
  const auto take = [&](SqlConnection& connection) -> Status {
    const int64_t now = unix_time_ms();
    VOXELD_ASSIGN(const std::optional<std::string> id,
                  claim_next(connection, worker, now, order, pick));
    if (!id) return {};
    VOXELD_ASSIGN(const JobRecord taken, load_job(connection, Caller::daemon(), *id));
    if (taken.use_cache) {
      VOXELD_ASSIGN(const int64_t cached,
                    cached_result(connection, taken.tenant, taken.request_hash, is_stored_));
      if (cached != 0) VOXELD_TRY(end_with_cached(connection, *id, cached, now));
    }
    VOXELD_ASSIGN(claimed, record_change(connection, *id));
    return {};
  };
  // A claim that power loss undoes ends with its worker: the job waits as before.
  VOXELD_TRY(database_.write(take, Durability::kSoon));
  return claimed;
}

Result<std::optional<JobRecord>> JobStore::complete(const FinishedTask& task, const LiveJob& live) {
  std::optional<JobRecord> ended;
  const auto end = [&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto running, fenced_job(connection, task.task, task.fence));
    if (!running) return {};
    VOXELD_ASSIGN(const int64_t used, used_bytes(connection, running->tenant));
    VOXELD_ASSIGN(const int64_t result_seq, insert_result(connection, *running, task));
    const Status kept = check_growth(connection, running->tenant, used, task.bytes_max);
    if (kept) {
      VOXELD_TRY(end_with_result(connection, *running, task, result_seq, live));
    } else {
      VOXELD_TRY(connection.run("DELETE FROM results WHERE seq = $1", result_seq));
      VOXELD_TRY(end_with_error(connection, task.task, kept.error(), live));
    }
    VOXELD_ASSIGN(ended, record_change(connection, task.task));
    return {};
  };
  VOXELD_TRY(database_.write(end, task.durability));
  return ended;
}

Result<std::optional<JobRecord>> JobStore::fail(std::string_view id, int64_t fence,
                                                const Error& error, const LiveJob& live) {
  std::optional<JobRecord> ended;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto running, fenced_job(connection, id, fence));
    if (!running) return {};
    VOXELD_TRY(end_with_error(connection, id, error, live));
    VOXELD_ASSIGN(ended, record_change(connection, id));
    return {};
  });
  VOXELD_TRY(committed);
  return ended;
}

Result<JobStore::Cancelled> JobStore::cancel(const Caller& caller, std::string_view id) {
  Cancelled result;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(JobRecord record, load_job(connection, caller, id));
    result.ended_now = record.status.state == JobState::kQueued;
    if (result.ended_now) {
      VOXELD_TRY(end_with_error(connection, id,
                                {ErrorCode::kCancelled, "the job was cancelled", "", ""}, 0));
      VOXELD_ASSIGN(record, record_change(connection, id));
    } else if (record.status.state == JobState::kRunning && !record.cancel_requested) {
      VOXELD_TRY(connection.run("UPDATE jobs SET cancel_requested = 1 WHERE id = $1", id));
      record.cancel_requested = true;
    }
    result.record = std::move(record);
    return {};
  });
  VOXELD_TRY(committed);
  return result;
}

Result<std::vector<std::string>> JobStore::forget(const Caller& caller, std::string_view id) {
  std::vector<std::string> ids;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const JobRecord record, load_job(connection, caller, id, JobTexts::kBrief));
    if (!record.status.ended()) {
      return Error{ErrorCode::kConflict,
                   "the job " + std::string(id) + " has not ended; cancel it first",
                   "done, failed or cancelled", std::string(job_state_name(record.status.state))};
    }
    return forget_job(connection, id, Expiry::kDeleted, ids);
  });
  VOXELD_TRY(committed);
  return ids;
}

Result<JobStore::Expired> JobStore::expire() {
  const int64_t now_ms = deadline_now_ms();
  Expired expired;
  {
    // Mostly there is nothing to write.
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(const Due due, next_due(*reader));
    expired.next_in_ms = due.deadline_ms == 0 ? 0 : due.deadline_ms - now_ms;
    if (due.deadline_ms == 0 || due.deadline_ms > now_ms) return expired;
  }
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    while (true) {
      VOXELD_ASSIGN(const Due due, next_due(connection));
      expired.next_in_ms = due.deadline_ms == 0 ? 0 : due.deadline_ms - now_ms;
      if (due.deadline_ms == 0 || due.deadline_ms > now_ms) return {};
      VOXELD_TRY(end_with_error(connection, due.id, deadline_error(), 0));
      VOXELD_ASSIGN(JobRecord record, record_change(connection, due.id));
      expired.ended.push_back(std::move(record));
    }
  });
  VOXELD_TRY(committed);
  return expired;
}

Status JobStore::check_grid(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return check_stored_grid(*reader, caller, id);
}

Status JobStore::check_result(std::string_view job) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return check_stored_result(*reader, job);
}

}  // namespace voxeld
