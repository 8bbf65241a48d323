// The queue and who works, as a caller may see it.
#pragma once

#include <vector>

#include "server/jobs/records/job_store.h"
#include "server/jobs/service/job_service.h"

namespace voxeld {

Result<QueueView> queue_view(JobStore& jobs, const std::vector<WorkerState>& workers,
                             const Caller& caller);

}  // namespace voxeld
