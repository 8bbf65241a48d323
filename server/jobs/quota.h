// What tenants have in the database, held against what they may have. Every function runs inside
// the transaction that its answer is for, so that two requests cannot both take the last of it.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string_view>

#include "proto/result.h"
#include "server/jobs/sqlite.h"
#include "server/jobs/tenant_limits.h"

namespace voxeld {

Result<TenantUsage> tenant_usage(SqlConnection& connection, std::string_view tenant);

// That one more job of the tenant may wait. Errors: too-many-requests.
Status check_tenant_queue(SqlConnection& connection, std::string_view tenant, int64_t queued_max);

struct NewBlob {
  std::string_view id;  // empty: none
  int64_t bytes = 0;
};
// That the tenant may have these, too; what it has already costs nothing. Errors: quota-exceeded,
// payload-too-large.
Status check_tenant_bytes(SqlConnection& connection, std::string_view tenant,
                          std::initializer_list<NewBlob> blobs, int64_t bytes_max);

// What is told of `asked` bytes that do not fit beside `used`: payload-too-large where they never
// could, else quota-exceeded.
Error bytes_error(int64_t asked, int64_t used, int64_t bytes_max);

}  // namespace voxeld
