// Which job runs next: first come, first served.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// Moves the oldest queued job to running and raises its attempt and fence, inside the caller's
// transaction. Returns its id, or nullopt when none waits.
Result<std::optional<std::string>> claim_next(SqlConnection& connection, std::string_view worker,
                                              int64_t now_ms);

}  // namespace voxeld
