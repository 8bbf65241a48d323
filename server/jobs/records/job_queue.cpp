#include "server/jobs/records/job_queue.h"

namespace voxeld {
namespace {

// The first tenant in alphabetical order behind `after` that has queued jobs. The tenant '' is a
// tenant, too, so the first one is asked for apart.
Result<std::optional<std::string>> next_tenant(SqlConnection& connection,
                                               const std::optional<std::string>& after) {
  VOXELD_ASSIGN(SqlStatement row,
                after ? connection.query("SELECT tenant FROM jobs WHERE state = 'queued'"
                                         " AND tenant > $1 ORDER BY tenant LIMIT 1",
                                         *after)
                      : connection.query("SELECT tenant FROM jobs WHERE state = 'queued'"
                                         " ORDER BY tenant LIMIT 1"));
  VOXELD_ASSIGN(const bool found, row.step());
  return found ? std::optional(row.text(0)) : std::nullopt;
}

QueueHead head_of_row(const SqlStatement& row) {
  return {row.text(0),  row.int64(1), static_cast<int>(row.int64(2)),
          row.int64(3), row.text(4),  row.text(5)};
}

// None or one.
Result<std::vector<QueueHead>> oldest(SqlConnection& connection) {
  VOXELD_ASSIGN(
      SqlStatement row,
      connection.query("SELECT tenant, seq, priority, deadline_ms, id, asset_tenant FROM jobs"
                       " WHERE state = 'queued' ORDER BY seq LIMIT 1"));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found) return std::vector<QueueHead>();
  return std::vector<QueueHead>{head_of_row(row)};
}

Result<std::optional<int64_t>> picked(SqlConnection& connection, QueueOrder order,
                                      const PickHead& pick) {
  const bool is_fair = order == QueueOrder::kFair && pick;
  VOXELD_ASSIGN(const std::vector<QueueHead> heads,
                is_fair ? queue_heads(connection) : oldest(connection));
  if (!pick && heads.empty()) return std::optional<int64_t>();
  const std::optional<size_t> which = pick ? pick(heads) : 0;
  return which ? std::optional(heads[*which].seq) : std::nullopt;
}

}  // namespace

Result<std::vector<QueueHead>> queue_heads(SqlConnection& connection) {
  std::vector<QueueHead> heads;
  std::optional<std::string> tenant;
  while (true) {
    VOXELD_ASSIGN(tenant, next_tenant(connection, tenant));
    if (!tenant) return heads;
    VOXELD_ASSIGN(
        SqlStatement row,
        connection.query("SELECT tenant, seq, priority, deadline_ms, id, asset_tenant FROM jobs"
                         " WHERE state = 'queued' AND tenant = $1"
                         " ORDER BY priority DESC, deadline_ms, seq LIMIT 1",
                         *tenant));
    VOXELD_ASSIGN(const bool found, row.step());
    if (found) heads.push_back(head_of_row(row));
  }
}

Result<std::optional<std::string>> claim_next(SqlConnection& connection, std::string_view worker,
                                              int64_t now_ms, QueueOrder order,
                                              const PickHead& pick) {
  VOXELD_ASSIGN(const std::optional<int64_t> seq, picked(connection, order, pick));
  if (!seq) return std::optional<std::string>();
  // `AND state = 'queued'`: on PostgreSQL another transaction may have taken the row meanwhile.
  VOXELD_ASSIGN(SqlStatement claimed,
                connection.query("UPDATE jobs SET state = 'running', attempt = attempt + 1,"
                                 " fence = fence + 1, version = version + 1, worker = $1,"
                                 " started_ms = $2"
                                 " WHERE seq = $3 AND state = 'queued' RETURNING id",
                                 worker, now_ms, *seq));
  VOXELD_ASSIGN(const bool found, claimed.step());
  if (!found) return std::optional<std::string>();
  return std::optional<std::string>(claimed.text(0));
}

}  // namespace voxeld
