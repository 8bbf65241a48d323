#include "server/jobs/scheduler.h"

namespace voxeld {

Result<std::optional<std::string>> claim_next(SqlConnection& connection, std::string_view worker,
                                              int64_t now_ms) {
  // `AND state = 'queued'` again outside: with SKIP LOCKED on PostgreSQL another transaction may
  // have taken the row between the inner and the outer statement.
  VOXELD_ASSIGN(SqlStatement claimed,
                connection.query("UPDATE jobs SET state = 'running', attempt = attempt + 1,"
                                 " fence = fence + 1, version = version + 1, worker = $1,"
                                 " started_ms = $2"
                                 " WHERE seq = (SELECT seq FROM jobs WHERE state = 'queued'"
                                 "              ORDER BY seq LIMIT 1)"
                                 " AND state = 'queued' RETURNING id",
                                 worker, now_ms));
  VOXELD_ASSIGN(const bool found, claimed.step());
  if (!found) return std::optional<std::string>();
  return std::optional<std::string>(claimed.text(0));
}

}  // namespace voxeld
