#include "server/jobs/records/quota.h"

#include <string>
#include <utility>

namespace voxeld {
namespace {

// In `live_jobs`, of all tenants together.
constexpr std::string_view kAllTenants = "*";

Result<int64_t> one_number(SqlStatement statement) {
  VOXELD_ASSIGN(const bool row, statement.step());
  return row ? statement.int64(0) : int64_t{0};
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
  VOXELD_ASSIGN(
      SqlStatement row,
      connection.query("SELECT bytes, record_bytes FROM tenant_usage WHERE tenant = $1", tenant));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found) return usage;
  usage.bytes = row.int64(0);
  usage.record_bytes = row.int64(1);
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

Result<int64_t> used_bytes(SqlConnection& connection, std::string_view tenant) {
  VOXELD_ASSIGN(SqlStatement found,
                connection.query("SELECT bytes FROM tenant_usage WHERE tenant = $1", tenant));
  return one_number(std::move(found));
}

Status check_growth(SqlConnection& connection, std::string_view tenant, int64_t used_before,
                    int64_t bytes_max) {
  if (bytes_max <= 0) return {};
  VOXELD_ASSIGN(const int64_t used, used_bytes(connection, tenant));
  if (used <= used_before || used <= bytes_max) return {};
  return bytes_error(used - used_before, used_before, bytes_max);
}

Status check_records(SqlConnection& connection, std::string_view tenant, int64_t bytes_max) {
  if (bytes_max <= 0) return {};
  VOXELD_ASSIGN(const TenantUsage usage, tenant_usage(connection, tenant));
  if (usage.record_bytes <= bytes_max) return {};
  return Error{ErrorCode::kTooManyRequests,
               "the records of this tenant's jobs take their share of the disk; those of jobs that"
               " ended are being removed, try again later",
               "at most " + std::to_string(bytes_max) + " bytes",
               std::to_string(usage.record_bytes)};
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
