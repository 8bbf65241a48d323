// A job as the gateway knows it, and the types by which jobs are submitted, listed and watched.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "proto/messages/job.h"

namespace voxeld {

// The deadline of a job that has none: it sorts behind all others.
inline constexpr int64_t kNoDeadline = INT64_MAX;

// A job with the facts that its public status leaves out.
struct JobRecord {
  JobStatus status;
  std::string tenant;        // whose job it is
  std::string asset_tenant;  // whose input it works on: the same, but for an admin's job
  int64_t seq = 0;           // order of arrival
  // By the clock of deadlines (KeptClock), which no jump of the system's clock changes.
  // status.deadline_at_ms is the same as it was announced at acceptance.
  int64_t deadline_ms = kNoDeadline;
  int64_t fence = 0;
  std::string request_hash;  // see request_hash.h
  bool use_cache = true;
  bool transient = false;
  bool cancel_requested = false;
  std::string worker;        // device that claimed it last
  std::string lost_workers;  // how each worker that ran it ended: "signal 9 (Killed), …"
  // That its worker took when it was ended because all workers together took too much; 0: never.
  int64_t displaced_bytes = 0;
  double upload_ms = 0;
  int64_t queued_ms = 0;             // Unix time: accepted, or last back in the queue
  std::string request_id, trace_id;  // of the request that submitted it
  bool was_preempted = false;        // by the change that gave this record
  bool is_result_gone = false;       // its result expired or was deleted
};

struct SubmitOptions {
  std::string idempotency_key;  // empty: none
  bool transient = false;       // a one-shot request's job: cancelled when its client leaves
  double upload_ms = 0;         // goes into the job's timings
  std::string request_id;       // for the log
  std::string trace_id;
};

struct JobEvent {
  int64_t id = 0;         // the job's version: monotonic per job
  std::string type;       // "state", "progress"
  std::string data_json;  // JobStatus as a row: proto/messages/job_text.h
};

enum class JobOrder { kNewestFirst, kOldestFirst };

// How much of a job is read.
enum class JobTexts {
  kWhole,
  kBrief,  // texts longer than limits::kRowTextBytesMax stay in the database: is_brief()
};

struct JobQuery {
  std::optional<JobState> state;
  JobOrder order = JobOrder::kNewestFirst;
  JobTexts texts = JobTexts::kWhole;
  std::optional<int64_t> after;  // seq of a job: those that come after it; nullopt: all
};

}  // namespace voxeld
