#include "server/jobs/records/result_store.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "proto/messages/job.h"
#include "server/jobs/model/results.h"
#include "server/jobs/records/expiry.h"
#include "server/jobs/records/visibility.h"

namespace voxeld {
namespace {

using Ids = ResultStore::Ids;

Result<std::vector<ExpiringResult>> results_of(SqlStatement rows) {
  std::vector<ExpiringResult> results;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return results;
    results.push_back({rows.int64(0), rows.text(1)});
  }
}

// The kept results of the caller whose `column` has this value.
template <typename Value>
Result<std::vector<ExpiringResult>> kept_results(SqlConnection& connection, const Caller& caller,
                                                 std::string_view column, const Value& value) {
  const std::string sql = "SELECT seq, job_id FROM results WHERE " + std::string(column) +
                          " = $1 AND " + std::string(column) + " <> '' AND expired_ms = 0 AND " +
                          (caller.sees_all() ? "$2 = $2" : "tenant = $2");
  VOXELD_ASSIGN(SqlStatement rows, connection.query(sql, value, caller.tenant()));
  return results_of(std::move(rows));
}

Status delete_all(SqlConnection& connection, const std::vector<ExpiringResult>& results, Ids& ids) {
  for (const ExpiringResult& result : results) {
    VOXELD_TRY(expire_result(connection, result, Expiry::kDeleted, ids));
  }
  return {};
}

struct JobRow {
  JobState state = JobState::kFailed;
  int64_t result_seq = 0;
};

Result<std::optional<JobRow>> find_job(SqlConnection& connection, const Caller& caller,
                                       std::string_view id) {
  VOXELD_ASSIGN(SqlStatement row,
                connection.query(std::string("SELECT state, result_seq FROM jobs WHERE id = $1"
                                             " AND ") +
                                     (caller.sees_all() ? "$2 = $2" : "tenant = $2"),
                                 id, caller.tenant()));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found) return std::optional<JobRow>();
  return std::optional(
      JobRow{job_state_from_name(row.text(0)).value_or(JobState::kFailed), row.int64(1)});
}

// The result of a job whose row has expired is found by the job's id.
Status delete_of_forgotten(SqlConnection& connection, const Caller& caller, std::string_view job,
                           Ids& ids) {
  VOXELD_ASSIGN(const auto results, kept_results(connection, caller, "job_id", job));
  if (!results.empty()) return delete_all(connection, results, ids);
  return Error{ErrorCode::kNotFound, "no such job", "the id of a job",
               std::string(job.substr(0, 80))};
}

Status delete_of(SqlConnection& connection, const Caller& caller, std::string_view job, Ids& ids) {
  VOXELD_ASSIGN(const std::optional<JobRow> row, find_job(connection, caller, job));
  if (!row) return delete_of_forgotten(connection, caller, job, ids);
  if (row->state == JobState::kQueued || row->state == JobState::kRunning) {
    return Error{ErrorCode::kConflict,
                 "the job " + std::string(job) + " has not ended; cancel it first",
                 "done, failed or cancelled", std::string(job_state_name(row->state))};
  }
  VOXELD_TRY(check_stored_result(connection, job));
  if (row->result_seq == 0) return expire_frames_of(connection, job, Expiry::kDeleted, ids);
  VOXELD_ASSIGN(SqlStatement found, connection.query("SELECT seq, job_id FROM results"
                                                     " WHERE seq = $1 AND expired_ms = 0",
                                                     row->result_seq));
  VOXELD_ASSIGN(const auto results, results_of(std::move(found)));
  return delete_all(connection, results, ids);
}

// A frame cannot be deleted from among others.
Status frame_error(SqlConnection& connection, const Caller& caller, std::string_view grid) {
  VOXELD_ASSIGN(SqlStatement row,
                connection.query(std::string("SELECT job_id FROM frames WHERE grid = $1"
                                             " AND expired_ms = 0 AND ") +
                                     (caller.sees_all() ? "$2 = $2" : "tenant = $2") + " LIMIT 1",
                                 grid, caller.tenant()));
  VOXELD_ASSIGN(const bool found, row.step());
  return Error{ErrorCode::kConflict,
               "the grid " + std::string(grid) + " is a frame of the job " +
                   (found ? row.text(0) : std::string()) + "; delete the result of that job",
               "a grid that is a result", "a frame"};
}

KeptResult read_kept(const SqlStatement& row, KeptKind kind) {
  KeptResult kept;
  kept.seq = row.int64(0);
  kept.job = row.text(1);
  kept.blob = row.text(2);
  kept.grid = row.text(3);
  kept.sequence = row.text(4);
  const int column = kind == KeptKind::kGrid ? 6 : kind == KeptKind::kSequence ? 7 : 5;
  kept.bytes = std::max<int64_t>(row.int64(column), 0);
  kept.media_type = row.text(8);
  kept.filename = row.text(9);
  kept.created_ms = row.int64(10);
  kept.frames = row.int64(11);
  return kept;
}

// Lists the newest of equal results, so that nothing is listed twice.
std::string list_sql(const Caller& caller, KeptKind kind) {
  std::string sql =
      "SELECT seq, job_id, blob, grid, sequence, bytes, grid_bytes, sequence_bytes, media_type,"
      " filename, created_ms, frames FROM results r WHERE expired_ms = 0 AND seq < $1 AND ";
  sql += caller.sees_all() ? "$2 = $2" : "tenant = $2";
  if (kind != KeptKind::kResult) {
    const std::string column = kind == KeptKind::kGrid ? "grid" : "sequence";
    sql += " AND r." + column + " <> '' AND NOT EXISTS (SELECT 1 FROM results n WHERE n." + column +
           " = r." + column + " AND n." + column +
           " <> '' AND n.tenant = r.tenant AND n.expired_ms = 0 AND n.seq > r.seq)";
  }
  return sql + " ORDER BY seq DESC LIMIT $3";
}

}  // namespace

Result<std::vector<KeptResult>> ResultStore::list(const Caller& caller, KeptKind kind, int limit,
                                                  int64_t before_seq) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  const int64_t below = before_seq > 0 ? before_seq : std::numeric_limits<int64_t>::max();
  VOXELD_ASSIGN(SqlStatement rows,
                reader->query(list_sql(caller, kind), below, caller.tenant(), int64_t{limit}));
  std::vector<KeptResult> results;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return results;
    results.push_back(read_kept(rows, kind));
  }
}

Result<Ids> ResultStore::delete_of_job(const Caller& caller, std::string_view job) {
  Ids ids;
  VOXELD_TRY(database_.write_freeing(
      [&](SqlConnection& connection) { return delete_of(connection, caller, job, ids); }));
  return ids;
}

Result<Ids> ResultStore::delete_grid(const Caller& caller, std::string_view id) {
  Ids ids;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(check_stored_grid(connection, caller, id));
    VOXELD_ASSIGN(const auto results, kept_results(connection, caller, "grid", id));
    if (results.empty()) return frame_error(connection, caller, id);
    return delete_all(connection, results, ids);
  });
  VOXELD_TRY(committed);
  return ids;
}

Result<Ids> ResultStore::delete_sequence(const Caller& caller, std::string_view id) {
  Ids ids;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(check_stored_sequence(connection, caller, id));
    VOXELD_ASSIGN(const auto results, kept_results(connection, caller, "sequence", id));
    return delete_all(connection, results, ids);
  });
  VOXELD_TRY(committed);
  return ids;
}

Result<Ids> ResultStore::drop_leftovers(std::string_view sequence) {
  constexpr std::string_view kLeft =
      "SELECT seq, job_id FROM results WHERE sequence = $1 AND sequence <> '' AND expired_ms <> 0";
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(SqlStatement rows, reader->query(kLeft, sequence));
    VOXELD_ASSIGN(const bool some, rows.step());
    if (!some) return Ids();
  }
  Ids ids;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(SqlStatement rows, connection.query(kLeft, sequence));
    VOXELD_ASSIGN(const auto results, results_of(std::move(rows)));
    for (const ExpiringResult& result : results) {
      {
        VOXELD_ASSIGN(
            SqlStatement grids,
            connection.query("SELECT DISTINCT grid FROM frames WHERE job_id = $1", result.job));
        VOXELD_TRY(collect_ids(std::move(grids), ids));
      }
      VOXELD_TRY(drop_rows(connection, result));
    }
    return {};
  });
  VOXELD_TRY(committed);
  return ids;
}

}  // namespace voxeld
