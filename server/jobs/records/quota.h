// Usage of tenants in the database, checked against their quotas. Every function runs inside the
// transaction that its result is for, so that two requests cannot both take the last of a quota.
#pragma once

#include <cstdint>
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
  int64_t bytes_max = 0;         // that the tenant may keep, with the rows of its jobs; 0: any
  int64_t record_bytes_max = 0;  // of TenantUsage::record_bytes; 0: any
};
// That one more job of the tenant may wait. Errors: too-many-requests, queue-full.
Status check_queue(SqlConnection& connection, std::string_view tenant, const QueueLimits& limits);

// The length of the tenant's longest blob; 0 if it has none.
Result<int64_t> longest_blob(SqlConnection& connection, std::string_view tenant);
// Whether a blob of the tenant is so long.
Result<bool> has_blob_of(SqlConnection& connection, std::string_view tenant, int64_t bytes);

// The bytes of the tenant's blobs and rows.
Result<int64_t> used_bytes(SqlConnection& connection, std::string_view tenant);
// That the tenant may have what it got in this transaction since used_bytes() was `used_before`. An
// error is for the caller to undo that. `bytes_max` 0: any. Errors: quota-exceeded,
// payload-too-large.
Status check_growth(SqlConnection& connection, std::string_view tenant, int64_t used_before,
                    int64_t bytes_max);
// That the rows of the tenant's jobs do not take more than their share of the disk. `bytes_max` 0:
// any. Errors: too-many-requests, since the sweep removes those of jobs that ended.
Status check_records(SqlConnection& connection, std::string_view tenant, int64_t bytes_max);

// The error for `asked` bytes that do not fit beside `used`: payload-too-large if they never could,
// else quota-exceeded.
Error bytes_error(int64_t asked, int64_t used, int64_t bytes_max);

}  // namespace voxeld
