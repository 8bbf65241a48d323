#include "server/jobs/records/job_changes.h"

#include <utility>

#include "proto/messages/job_text.h"
#include "server/base/clock.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/records/job_rows.h"

namespace voxeld {

Result<std::vector<JobEvent>> load_events(SqlConnection& connection, std::string_view id,
                                          int64_t after_id, int64_t count) {
  std::vector<JobEvent> events;
  {
    VOXELD_ASSIGN(SqlStatement rows, connection.query("SELECT id, type, data_json FROM job_events"
                                                      " WHERE job_id = $1 AND id > $2 ORDER BY id"
                                                      " LIMIT $3",
                                                      id, after_id, count));
    while (true) {
      VOXELD_ASSIGN(const bool row, rows.step());
      if (!row) break;
      events.push_back({rows.int64(0), rows.text(1), rows.text(2)});
    }
  }
  if (events.empty()) return events;
  VOXELD_ASSIGN(const JobRecord record,
                load_job(connection, Caller::daemon(), id, JobTexts::kBrief));
  for (JobEvent& event : events) {
    event.data_json = with_fixed_members(std::move(event.data_json), record.status);
  }
  return events;
}

Result<JobRecord> record_change(SqlConnection& connection, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, load_job(connection, Caller::daemon(), id));
  VOXELD_TRY(connection.run(
      "INSERT INTO job_events (job_id, id, type, data_json, created_ms, tenant) VALUES ($1, "
      "$2, $3, $4, $5, $6)",
      id, record.status.version, "state", job_event_text(record.status), unix_time_ms(),
      record.tenant));
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
