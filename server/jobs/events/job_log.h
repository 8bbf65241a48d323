// Log lines about jobs.
#pragma once
#include "server/jobs/model/job_record.h"

namespace voxeld {

// A job was claimed, put back or ended.
void log_job_change(const JobRecord& record);

}  // namespace voxeld
