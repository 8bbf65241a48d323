// The queue and who works, as a caller may see it.
#pragma once

#include <functional>
#include <vector>

#include "server/jobs/records/job_store.h"
#include "server/jobs/service/job_service.h"

namespace voxeld {

// At most `limit` jobs that wait. `overlay` adds to a status what the database does not know.
Result<QueueView> queue_view(JobStore& jobs, const std::vector<WorkerState>& workers,
                             const Caller& caller, int limit,
                             const std::function<void(JobStatus&)>& overlay);

}  // namespace voxeld
