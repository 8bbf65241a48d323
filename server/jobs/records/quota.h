// Usage of tenants in the database, checked against their quotas. Every function runs inside the
// transaction that its result is for, so that two requests cannot both take the last of a quota.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string_view>

#include "proto/result.h"
#include "server/jobs/database/sql.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {

// Jobs that wait and that run, as counters in the database have them: they take no longer where
// many wait.
struct LiveJobs {
  int64_t queued = 0, running = 0;
};
Result<LiveJobs> live_jobs(SqlConnection& connection);  // of all tenants
Result<LiveJobs> live_jobs(SqlConnection& connection, std::string_view tenant);

Result<TenantUsage> tenant_usage(SqlConnection& connection, std::string_view tenant);

struct QueueLimits {
  int64_t in_all = 0;     // places in the queue; more jobs: queue-full
  int64_t of_tenant = 0;  // jobs of the tenant that wait; 0: any
  // Several tenants share the queue. A job is then taken only where its tenant has fewer jobs
  // waiting than places are free: dynamic thresholds, with alpha 1, of A. K. Choudhury and E. L.
  // Hahne, "Dynamic Queue Length Thresholds for Shared-Memory Packet Switches" (1998). One tenant
  // can fill half of the queue, n tenants n/(n + 1) of it; whoever has no job there finds a place.
  bool is_shared = false;
  int64_t bytes_max = 0;  // that the tenant may keep, with the rows of its jobs; 0: any
};
// That one more job of the tenant may wait. Errors: too-many-requests, queue-full.
Status check_queue(SqlConnection& connection, std::string_view tenant, const QueueLimits& limits);

// Bytes of a row's texts that do not count; the triggers of schema step 10 have the same number.
inline constexpr int64_t kRowBytesFree = 4096;
// The bytes by which a row with these texts counts towards its tenant's quota.
int64_t row_bytes(std::initializer_list<std::string_view> texts);

// The length of the tenant's longest blob; 0 if it has none.
Result<int64_t> longest_blob(SqlConnection& connection, std::string_view tenant);
// Whether a blob of the tenant is so long.
Result<bool> has_blob_of(SqlConnection& connection, std::string_view tenant, int64_t bytes);

struct NewBlob {
  std::string_view id;  // empty: none
  int64_t bytes = 0;
};
// That the tenant may have these, and `in_rows` bytes in new rows, too; what it has already costs
// nothing. Errors: quota-exceeded, payload-too-large.
Status check_tenant_bytes(SqlConnection& connection, std::string_view tenant,
                          std::initializer_list<NewBlob> blobs, int64_t in_rows, int64_t bytes_max);

// The error for `asked` bytes that do not fit beside `used`: payload-too-large if they never could,
// else quota-exceeded.
Error bytes_error(int64_t asked, int64_t used, int64_t bytes_max);

}  // namespace voxeld
