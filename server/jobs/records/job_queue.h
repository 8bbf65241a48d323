// Which queued job runs next.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/jobs/database/sql.h"
#include "server/jobs/model/job_record.h"

namespace voxeld {

// A tenant's first queued job: of the highest priority, then of the earliest deadline, then that
// which arrived first.
struct QueueHead {
  std::string tenant;
  int64_t seq = 0;  // order of arrival
  int priority = 0;
  int64_t deadline_ms = kNoDeadline;  // as JobRecord has it
  std::string id;
  std::string input_tenant = {};  // whose input it works on (JobRecord::asset_tenant)
};

// The first queued job of each tenant. Takes a few look-ups in an index for each of them.
Result<std::vector<QueueHead>> queue_heads(SqlConnection& connection);

// The heads that a claim chooses among: one of each tenant, or the job alone that arrived first of
// all.
enum class QueueOrder { kFair, kArrival };

// Which of them is claimed; nullopt: none now. Without one, jobs are claimed as they arrived.
using PickHead = std::function<std::optional<size_t>(const std::vector<QueueHead>& heads)>;

// Moves a queued job to running and raises its attempt and fence, inside the caller's transaction.
// Returns its id, or nullopt when none waits or is picked. Takes a few look-ups in an index for
// each tenant that has jobs in the queue, however many.
Result<std::optional<std::string>> claim_next(SqlConnection& connection, std::string_view worker,
                                              int64_t now_ms, QueueOrder order,
                                              const PickHead& pick);

}  // namespace voxeld
