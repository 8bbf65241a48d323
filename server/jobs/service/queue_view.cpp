#include "server/jobs/service/queue_view.h"

#include <algorithm>

namespace voxeld {

Result<QueueView> queue_view(JobStore& jobs, const std::vector<WorkerState>& workers,
                             const Caller& caller) {
  QueueView view;
  VOXELD_ASSIGN(const LiveJobs all, jobs.live());
  VOXELD_ASSIGN(const LiveJobs own, jobs.live(caller));
  view.queued = all.queued;
  view.running = all.running;
  // Between the two a job may have started.
  view.others_queued = std::max<int64_t>(0, all.queued - own.queued);
  view.others_running = std::max<int64_t>(0, all.running - own.running);
  for (const WorkerState& worker : workers) {
    const auto known = std::ranges::find(view.devices, worker.device, &QueueView::Device::device);
    QueueView::Device& device = known == view.devices.end() ? view.devices.emplace_back() : *known;
    device.device = worker.device;
    if (!worker.renderer.empty()) device.renderer = worker.renderer;
    device.workers += worker.connected ? 1 : 0;
    device.memory_bytes += worker.memory_bytes;
    if (worker.task.empty()) continue;
    ++device.workers_busy;
    if (jobs.get(caller, worker.task)) device.jobs.push_back(worker.task);
  }
  return view;
}

}  // namespace voxeld
