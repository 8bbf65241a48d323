// Which started jobs give up their workers, so that tenants that have none get one: a worker runs a
// job until it ends, and giant ones take hours.
//
// A preempted job is queued again and goes on later with what it has done
// (proto/messages/task_api.h), so all that is lost is its preparation: reading the mesh, placing
// and snapping it, and taking over the tiles before. Jobs that look at the whole surface (fills,
// signed distances), and whatever reads, draws or encodes, cannot be preempted; their workers say
// so.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "server/jobs/records/job_queue.h"
#include "server/jobs/scheduling/slots.h"

namespace voxeld {

// A job works at least so long between its preparation and its preemption. It grows with what the
// job has had of the device already, so that its parts do not become too many.
inline constexpr double kPreemptQuantumSecondsMin = 1, kPreemptQuantumSecondsMax = 10;
inline constexpr double kPreemptQuantumShare = 0.02;
// … and so many times as long as its preparation took: preemption costs less than a tenth.
inline constexpr double kPreemptPreparations = 10;
// Seconds of the device that a tenant must be ahead of the one that waits. Less is noise: time
// slices alternate, and two tenants would only pass a worker to and fro.
inline constexpr double kPreemptMarginSeconds = 0.25;
// A queued job's deadline is in danger where less is left than so many times what it is expected to
// take, and a little.
inline constexpr double kDeadlineReserve = 2, kDeadlineReserveSeconds = 5;

struct PreemptionView {
  const std::vector<QueueHead>& heads;
  const std::vector<StartedJob>& started;  // on the device, whose workers all have one
  // Device time over the tenant's weight (TenantShares), and that weight.
  std::function<double(const std::string& tenant)> share;
  std::function<double(const std::string& tenant)> weight;
  // That a queued job is expected to take; 0: not known.
  std::function<double(const std::string& job)> expected_seconds;
  int64_t now_ms = 0;  // by the clock of deadlines
};

// Whether it has worked for long enough since it was started.
bool may_be_preempted(const StartedJob& job);

// The jobs of `started` to preempt, by index; a job that was asked before stays asked as long as
// any tenant waits. For each tenant without a worker, in the order of their shares, one of
//  - a tenant that has several, who loses nothing: a tenant's jobs share its time slices;
//  - the tenant that has had most, where it is ahead of the one that waits.
// If all tenants have one, a tenant's own job of lower priority, or of a later deadline if that of
// the queued one is in danger.
std::vector<size_t> jobs_to_preempt(const PreemptionView& view);

// A job that cannot be preempted is expected to end soon until it has had its worker for so long.
inline constexpr double kSoonSeconds = 5;
// A job that still has to work for longer before it may be preempted counts as one that cannot be.
inline constexpr double kPreemptedSoonSeconds = 60;

// Whether a tenant waits without a worker, and too few started jobs will give one up soon.
bool is_left_out(const PreemptionView& view);

}  // namespace voxeld
