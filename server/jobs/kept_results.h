// Whether the rows say that a result, grid or sequence is still kept. The store alone does not
// tell: a blob that one tenant deleted stays where others have the same bytes.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/jobs/caller.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// Errors: not-found for what the caller never had, and may not see; gone, with the reason: deleted,
// or expired.
Status check_kept_grid(SqlConnection& connection, const Caller& caller, std::string_view id);
Status check_kept_sequence(SqlConnection& connection, const Caller& caller, std::string_view id);
// Checks the result of a job that is done. Errors: gone.
Status check_kept_result(SqlConnection& connection, std::string_view job);

}  // namespace voxeld
