#include "server/jobs/job_changes.h"

#include "proto/job_text.h"

namespace voxeld {

Result<JobRecord> record_change(SqlConnection& connection, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, load_job(connection, Caller::daemon(), id));
  VOXELD_TRY(
      connection.run("INSERT INTO job_events (job_id, id, type, data_json, created_ms) VALUES ($1, "
                     "$2, $3, $4, $5)",
                     id, record.status.version, "state", job_row_text(record.status),
                     unix_time_ms()));
  return record;
}

Result<std::optional<JobRecord>> fenced_job(SqlConnection& connection, std::string_view id,
                                            int64_t fence) {
  VOXELD_ASSIGN(JobRecord record, load_job(connection, Caller::daemon(), id));
  if (record.status.state != JobState::kRunning || record.fence != fence) {
    return std::optional<JobRecord>();
  }
  return std::optional<JobRecord>(std::move(record));
}

Status end_with_error(SqlConnection& connection, std::string_view id, const Error& error,
                      const LiveJob& live) {
  const JobState state =
      error.code == ErrorCode::kCancelled ? JobState::kCancelled : JobState::kFailed;
  return connection.run(
      "UPDATE jobs SET state = $2, error_code = $3, error_detail = $4, error_expected = $5,"
      " error_got = $6, ended_ms = $7,"
      " version = CASE WHEN version > $8 THEN version ELSE $8 END + 1,"
      " device_us = device_us + $9 WHERE id = $1",
      id, job_state_name(state), info_of(error.code).name, error.detail, error.expected, error.got,
      unix_time_ms(), live.version, live.device_us);
}

}  // namespace voxeld
