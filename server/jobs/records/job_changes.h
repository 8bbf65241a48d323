// Steps that changes of a job are made of, inside the caller's transaction.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "server/jobs/database/sql.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/records/job_store.h"

namespace voxeld {

inline constexpr int64_t kIdempotencyKeptMs = int64_t{24} * 60 * 60 * 1000;

// Reads the job back after a change and writes the event of it: its status but for what is in other
// rows.
Result<JobRecord> record_change(SqlConnection& connection, std::string_view id);
// At most `count` of the job's events after `after_id`, oldest first, each with its status as a
// row of a list (job_text.h).
Result<std::vector<JobEvent>> load_events(SqlConnection& connection, std::string_view id,
                                          int64_t after_id, int64_t count);
// The job, when it is running with this fence.
Result<std::optional<JobRecord>> fenced_job(SqlConnection& connection, std::string_view id,
                                            int64_t fence);
// Failed, or cancelled where that is the error.
Status end_with_error(SqlConnection& connection, std::string_view id, const Error& error,
                      const LiveJob& live);

}  // namespace voxeld
