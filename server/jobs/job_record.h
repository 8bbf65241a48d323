// A row of the table jobs, with its result.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/job.h"
#include "proto/result.h"
#include "server/jobs/caller.h"
#include "server/jobs/job_query.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// A job with the facts that its public status leaves out.
struct JobRecord {
  JobStatus status;
  std::string tenant;        // whose job it is
  std::string asset_tenant;  // whose input it works on: the same, but for an admin's job
  int64_t seq = 0;           // order of arrival
  int64_t fence = 0;
  std::string request_hash;  // see request_hash.h
  bool use_cache = true;
  bool transient = false;
  bool cancel_requested = false;
  std::string worker;        // device that claimed it last
  std::string lost_workers;  // how each worker that ran it ended: "signal 9 (Killed), …"
  double upload_ms = 0;
  int64_t queued_ms = 0;             // Unix time: accepted, or parked last
  std::string request_id, trace_id;  // of the request that submitted it
  bool was_parked = false;           // by the change that gave this record
};

// The error of a job whose deadline has passed.
Error deadline_error();
// Milliseconds since 1970.
int64_t unix_time_ms();
// Fills in queue_position too. Errors: not-found, also for what the caller may not see.
Result<JobRecord> load_job(SqlConnection& connection, const Caller& caller, std::string_view id,
                           JobTexts texts = JobTexts::kWhole);
// Calls `take` with one job after the other, queue_position filled in, until it gives false or an
// error. Errors: those of `take`; invalid-option for `query.after`.
Status each_job(SqlConnection& connection, const Caller& caller, const JobQuery& query,
                const std::function<Result<bool>(JobRecord&&)>& take);

// Columns that hold lists.
std::string timings_text(const StageTimes& timings);
std::string warnings_text(const std::vector<Warning>& warnings);

}  // namespace voxeld
