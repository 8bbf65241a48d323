// Reads rows of the table jobs, with their results.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/jobs/database/sql.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"

namespace voxeld {

// The error of a job whose deadline has passed.
Error deadline_error();
// Fills in queue_position too. Errors: not-found, also for what the caller may not see.
Result<JobRecord> load_job(SqlConnection& connection, const Caller& caller, std::string_view id,
                           JobTexts texts = JobTexts::kWhole);
// Calls `take` with one job after the other, queue_position filled in, until it gives false or an
// error. Errors: those of `take`; invalid-option for `query.after`.
Status each_job(SqlConnection& connection, const Caller& caller, const JobQuery& query,
                const std::function<Result<bool>(JobRecord&&)>& take);

// Columns that hold lists.
std::string timings_text(const StageTimes& timings);
std::string warnings_text(const std::vector<Warning>& warnings);

}  // namespace voxeld
