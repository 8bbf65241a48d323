#include "server/jobs/records/quota.h"

#include <algorithm>
#include <string>
#include <vector>

namespace voxeld {
namespace {

// In `live_jobs`, of all tenants together.
constexpr std::string_view kAllTenants = "*";

Result<int64_t> one_number(SqlStatement statement) {
  VOXELD_ASSIGN(const bool row, statement.step());
  return row ? statement.int64(0) : int64_t{0};
}

Result<int64_t> used_bytes(SqlConnection& connection, std::string_view tenant) {
  VOXELD_ASSIGN(SqlStatement found,
                connection.query("SELECT bytes FROM tenant_usage WHERE tenant = $1", tenant));
  return one_number(std::move(found));
}

Result<bool> has_blob(SqlConnection& connection, std::string_view tenant, std::string_view id) {
  VOXELD_ASSIGN(
      SqlStatement found,
      connection.query("SELECT 1 FROM holdings WHERE tenant = $1 AND blob = $2", tenant, id));
  return found.step();
}

}  // namespace

Result<LiveJobs> live_jobs(SqlConnection& connection) {
  return live_jobs(connection, kAllTenants);
}

Result<LiveJobs> live_jobs(SqlConnection& connection, std::string_view tenant) {
  VOXELD_ASSIGN(
      SqlStatement row,
      connection.query("SELECT queued, running FROM live_jobs WHERE tenant = $1", tenant));
  VOXELD_ASSIGN(const bool found, row.step());
  return found ? LiveJobs{row.int64(0), row.int64(1)} : LiveJobs{};
}

Result<TenantUsage> tenant_usage(SqlConnection& connection, std::string_view tenant) {
  TenantUsage usage;
  VOXELD_ASSIGN(const LiveJobs live, live_jobs(connection, tenant));
  usage.queued_jobs = live.queued;
  usage.running_jobs = live.running;
  VOXELD_ASSIGN(usage.bytes, used_bytes(connection, tenant));
  return usage;
}

Status check_queue(SqlConnection& connection, std::string_view tenant, const QueueLimits& limits) {
  VOXELD_ASSIGN(const LiveJobs own, live_jobs(connection, tenant));
  if (limits.of_tenant > 0 && own.queued >= limits.of_tenant) {
    return Error{ErrorCode::kTooManyRequests, "too many jobs of this tenant wait; try again later",
                 "fewer than " + std::to_string(limits.of_tenant), std::to_string(own.queued)};
  }
  VOXELD_ASSIGN(const LiveJobs all, live_jobs(connection));
  const int64_t places_free = limits.in_all - all.queued;
  if (places_free <= 0) {
    return Error{ErrorCode::kQueueFull, "too many jobs are waiting; try again later",
                 "fewer than " + std::to_string(limits.in_all), std::to_string(all.queued)};
  }
  if (!limits.is_shared || own.queued < places_free) return {};
  return Error{
      ErrorCode::kTooManyRequests, "this tenant's share of the queue is used up; try again later",
      "fewer jobs of the tenant than the " + std::to_string(places_free) + " places that are free",
      std::to_string(own.queued)};
}

int64_t row_bytes(std::initializer_list<std::string_view> texts) {
  int64_t bytes = -kRowBytesFree;
  for (const std::string_view text : texts) bytes += static_cast<int64_t>(text.size());
  return std::max<int64_t>(bytes, 0);
}

Result<int64_t> longest_blob(SqlConnection& connection, std::string_view tenant) {
  VOXELD_ASSIGN(SqlStatement found, connection.query("SELECT bytes FROM holdings WHERE tenant = $1"
                                                     " ORDER BY bytes DESC LIMIT 1",
                                                     tenant));
  return one_number(std::move(found));
}

Result<bool> has_blob_of(SqlConnection& connection, std::string_view tenant, int64_t bytes) {
  VOXELD_ASSIGN(SqlStatement found, connection.query("SELECT 1 FROM holdings WHERE tenant = $1"
                                                     " AND bytes = $2 LIMIT 1",
                                                     tenant, bytes));
  return found.step();
}

Status check_tenant_bytes(SqlConnection& connection, std::string_view tenant,
                          std::initializer_list<NewBlob> blobs, int64_t in_rows,
                          int64_t bytes_max) {
  if (bytes_max <= 0) return {};
  int64_t asked = in_rows;
  std::vector<std::string_view> counted;
  for (const NewBlob& blob : blobs) {
    if (blob.id.empty() || std::ranges::count(counted, blob.id) != 0) continue;
    counted.push_back(blob.id);
    VOXELD_ASSIGN(const bool has, has_blob(connection, tenant, blob.id));
    if (!has) asked += blob.bytes;
  }
  VOXELD_ASSIGN(const int64_t used, used_bytes(connection, tenant));
  if (asked == 0 || asked <= bytes_max - used) return {};
  return bytes_error(asked, used, bytes_max);
}

Error bytes_error(int64_t asked, int64_t used, int64_t bytes_max) {
  const std::string numbers = std::to_string(asked) + " beside " + std::to_string(used) + " used";
  const std::string most = "at most " + std::to_string(bytes_max) + " bytes in all";
  if (asked > bytes_max) {
    return {ErrorCode::kPayloadTooLarge, "more than this tenant may ever keep", most, numbers};
  }
  return {ErrorCode::kQuotaExceeded, "this tenant's storage is used up; delete some of it", most,
          numbers};
}

}  // namespace voxeld
