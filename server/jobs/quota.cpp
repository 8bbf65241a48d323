#include "server/jobs/quota.h"

#include <algorithm>
#include <string>
#include <vector>

namespace voxeld {
namespace {

Result<int64_t> one_number(SqlStatement statement) {
  VOXELD_ASSIGN(const bool row, statement.step());
  return row ? statement.int64(0) : int64_t{0};
}

Result<int64_t> count_jobs(SqlConnection& connection, std::string_view tenant,
                           std::string_view state) {
  // Literals, so that the partial indexes of these states serve.
  const std::string sql =
      "SELECT COUNT(*) FROM jobs WHERE tenant = $1 AND state = '" + std::string(state) + "'";
  VOXELD_ASSIGN(SqlStatement count, connection.query(sql, tenant));
  return one_number(std::move(count));
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

Result<TenantUsage> tenant_usage(SqlConnection& connection, std::string_view tenant) {
  TenantUsage usage;
  VOXELD_ASSIGN(usage.queued_jobs, count_jobs(connection, tenant, "queued"));
  VOXELD_ASSIGN(usage.running_jobs, count_jobs(connection, tenant, "running"));
  VOXELD_ASSIGN(usage.bytes, used_bytes(connection, tenant));
  return usage;
}

Status check_tenant_queue(SqlConnection& connection, std::string_view tenant, int64_t queued_max) {
  if (queued_max <= 0) return {};
  VOXELD_ASSIGN(const int64_t queued, count_jobs(connection, tenant, "queued"));
  if (queued < queued_max) return {};
  return Error{ErrorCode::kTooManyRequests, "too many jobs of this tenant wait; try again later",
               "fewer than " + std::to_string(queued_max), std::to_string(queued)};
}

Status check_tenant_bytes(SqlConnection& connection, std::string_view tenant,
                          std::initializer_list<NewBlob> blobs, int64_t bytes_max) {
  if (bytes_max <= 0) return {};
  int64_t asked = 0;
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
