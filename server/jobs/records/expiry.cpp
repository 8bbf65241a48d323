#include "server/jobs/records/expiry.h"

#include <utility>

#include "server/base/clock.h"

namespace voxeld {
namespace {

using Ids = std::vector<std::string>;

Status blobs_of_result(SqlConnection& connection, const ExpiringResult& result, Ids& ids) {
  for (const char* column : {"blob", "grid", "sequence"}) {
    VOXELD_ASSIGN(SqlStatement rows,
                  connection.query("SELECT " + std::string(column) + " FROM results WHERE seq = $1",
                                   result.seq));
    VOXELD_TRY(collect_ids(std::move(rows), ids));
  }
  return {};
}

}  // namespace

Status collect_ids(SqlStatement rows, std::vector<std::string>& ids) {
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return {};
    if (std::string id = rows.text(0); !id.empty()) ids.push_back(std::move(id));
  }
}

Status expire_frames_of(SqlConnection& connection, std::string_view job, Expiry why, Ids& ids) {
  if (job.empty()) return {};
  {
    VOXELD_ASSIGN(SqlStatement rows, connection.query("SELECT DISTINCT grid FROM frames"
                                                      " WHERE job_id = $1 AND expired_ms = 0",
                                                      job));
    VOXELD_TRY(collect_ids(std::move(rows), ids));
  }
  return connection.run(
      "UPDATE frames SET expired_ms = $2, is_deleted = $3 WHERE job_id = $1 AND expired_ms = 0",
      job, unix_time_ms(), int64_t{why == Expiry::kDeleted});
}

Status drop_rows(SqlConnection& connection, const ExpiringResult& result) {
  constexpr std::string_view kIsWorkedOn =
      "EXISTS (SELECT 1 FROM results w JOIN jobs n ON n.sequence = w.sequence WHERE w.seq = $1"
      " AND n.state IN ('queued', 'running') AND n.sequence <> '')";
  VOXELD_TRY(
      connection.run("DELETE FROM frames WHERE job_id = $2 AND EXISTS"
                     " (SELECT 1 FROM results WHERE seq = $1 AND expired_ms <> 0) AND NOT EXISTS"
                     " (SELECT 1 FROM jobs WHERE id = $2) AND NOT " +
                         std::string(kIsWorkedOn),
                     result.seq, result.job));
  return connection.run(
      "DELETE FROM results WHERE seq = $1 AND expired_ms <> 0 AND NOT EXISTS"
      " (SELECT 1 FROM jobs WHERE result_seq = $1) AND NOT " +
          std::string(kIsWorkedOn),
      result.seq);
}

// A result that no job refers to leaves no row behind: nobody could ask for it. But rows of frames
// stay while a live job works on their sequence: they keep the frames' blobs for it.
Status expire_result(SqlConnection& connection, const ExpiringResult& result, Expiry why,
                     Ids& ids) {
  VOXELD_TRY(blobs_of_result(connection, result, ids));
  VOXELD_TRY(expire_frames_of(connection, result.job, why, ids));
  VOXELD_TRY(
      connection.run("UPDATE results SET expired_ms = $2, is_deleted = $3, meta_json = '{}',"
                     " warnings_json = '[]' WHERE seq = $1",
                     result.seq, unix_time_ms(), int64_t{why == Expiry::kDeleted}));
  return drop_rows(connection, result);
}

Status forget_job(SqlConnection& connection, std::string_view id, Expiry why, Ids& ids) {
  VOXELD_TRY(connection.run("DELETE FROM job_events WHERE job_id = $1", id));
  VOXELD_TRY(connection.run("DELETE FROM idempotency_keys WHERE job_id = $1", id));
  int64_t result = 0;
  {
    VOXELD_ASSIGN(SqlStatement row,
                  connection.query("SELECT result_seq FROM jobs WHERE id = $1", id));
    VOXELD_TRY(row.step());
    result = row.int64(0);
  }
  VOXELD_TRY(connection.run("DELETE FROM jobs WHERE id = $1", id));
  VOXELD_TRY(drop_rows(connection, {result, std::string(id)}));
  // Kept, or deleted while a live job works on its sequence: its end drops the rows.
  VOXELD_ASSIGN(SqlStatement kept,
                connection.query("SELECT 1 FROM results w WHERE w.job_id = $1 AND (w.expired_ms = 0"
                                 " OR EXISTS (SELECT 1 FROM jobs n WHERE n.sequence = w.sequence"
                                 " AND n.sequence <> '' AND n.state IN ('queued', 'running')))"
                                 " LIMIT 1",
                                 id));
  VOXELD_ASSIGN(const bool is_kept, kept.step());
  if (is_kept) return {};
  VOXELD_TRY(expire_frames_of(connection, id, why, ids));
  return connection.run("DELETE FROM frames WHERE job_id = $1", id);
}

}  // namespace voxeld
