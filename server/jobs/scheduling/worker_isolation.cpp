#include "server/jobs/scheduling/worker_isolation.h"

namespace voxeld {

std::optional<WorkerIsolation> worker_isolation_of(std::string_view name) {
  if (name == "none") return WorkerIsolation::kNone;
  if (name == "tenant") return WorkerIsolation::kTenant;
  if (name == "task") return WorkerIsolation::kTask;
  return std::nullopt;
}

int reserve_of(WorkerIsolation isolation, int workers_per_device) {
  switch (isolation) {
    case WorkerIsolation::kNone:
      return 0;
    case WorkerIsolation::kTenant:
      return 1;
    case WorkerIsolation::kTask:  // each task takes one
      return workers_per_device;
  }
  return 0;
}

void WorkerPast::add(std::string_view tenant, std::string_view input_tenant) {
  is_mixed_ = is_mixed_ || tenant != input_tenant || (tenant_ && *tenant_ != tenant);
  tenant_ = tenant;
}

bool WorkerPast::may_run(WorkerIsolation isolation, std::string_view tenant,
                         std::string_view input_tenant) const {
  if (isolation == WorkerIsolation::kNone || is_fresh()) return true;
  return !is_used_up(isolation) && *tenant_ == tenant && tenant == input_tenant;
}

bool WorkerPast::is_used_up(WorkerIsolation isolation) const {
  switch (isolation) {
    case WorkerIsolation::kNone:
      return false;
    case WorkerIsolation::kTenant:
      return is_mixed_;
    case WorkerIsolation::kTask:
      return !is_fresh();
  }
  return false;
}

}  // namespace voxeld
