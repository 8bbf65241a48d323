// Which rows a caller may read: those of its tenant, and of results those that are still stored.
// The blob store alone does not tell: a blob that one tenant deleted stays where others have the
// same bytes.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/jobs/database/sql.h"
#include "server/jobs/model/caller.h"

namespace voxeld {

// Whether `sql`, a SELECT that ends in a condition on $1, finds a row that the caller may see. Its
// table has a column `tenant`.
Result<bool> sees_row(SqlConnection& connection, const Caller& caller, std::string_view sql,
                      std::string_view id);

// Errors: not-found for what the caller never had, and may not see; gone, with the reason: deleted,
// or expired.
Status check_stored_grid(SqlConnection& connection, const Caller& caller, std::string_view id);
Status check_stored_sequence(SqlConnection& connection, const Caller& caller, std::string_view id);
// Checks the result of a job that is done. Errors: gone.
Status check_stored_result(SqlConnection& connection, std::string_view job);

}  // namespace voxeld
