// SQL that a tenant's rows are found by.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/jobs/caller.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// Whether `sql`, a SELECT that ends in a condition on $1, finds a row that the caller may see. Its
// table has a column `tenant`.
Result<bool> sees_row(SqlConnection& connection, const Caller& caller, std::string_view sql,
                      std::string_view id);

}  // namespace voxeld
