// The task server's side of isolation: which workers are replaced, and when (worker_isolation.h).
#include <algorithm>
#include <map>
#include <utility>

#include "server/base/log.h"
#include "server/jobs/workers/task_connection.h"

namespace voxeld {
namespace {

// If a process that should be starting does not come, one more is replaced after so long, as
// long as a job waits for it.
constexpr std::chrono::seconds kReplacePeriod{5};

}  // namespace

WorkerIsolation TaskServer::isolation() const {
  return config_.isolation ? config_.isolation() : WorkerIsolation::kNone;
}

int TaskServer::reserve() const {
  return config_.reserve ? config_.reserve() : 0;
}

// Tasks that may start now. Workers of others than the daemon add to those that it runs itself.
size_t TaskServer::free_slots(const DeviceSlots& slots) const {
  const int held_back = reserve();
  if (held_back == 0) return slots.idle.size();
  const int places = std::max(config_.workers_per_device, slots.connected - held_back);
  const int free = places - static_cast<int>(slots.started.size());
  return std::min(slots.idle.size(), static_cast<size_t>(std::max(free, 0)));
}

// Whether any device could start one more task.
bool TaskServer::is_free_slot_left() const {
  std::map<std::string, DeviceSlots> devices;
  for (const auto& connection : connections_) {
    if (connection->idle.connection == 0) continue;
    DeviceSlots& slots = devices[connection->device];
    ++slots.connected;
    if (connection->started) slots.started.push_back(*connection->started);
    if (connection->is_idle) slots.idle.push_back(connection->idle);
  }
  return std::any_of(devices.begin(), devices.end(),
                     [&](const auto& device) { return free_slots(device.second) > 0; });
}

// How long heads of the queue wait for fresh workers; nullopt: nobody has looked into it.
void TaskServer::note_blocked(const std::string& device, std::optional<int> blocked) {
  Renewal& renewal = renewals_[device];
  const auto now = std::chrono::steady_clock::now();
  if (blocked > 0 && !renewal.blocked_since) renewal.blocked_since = now;
  if (blocked == 0 && renewal.blocked_since) {
    const std::chrono::duration<double> waited = now - *std::exchange(renewal.blocked_since, {});
    context_.metrics.waited_for_fresh_worker(device, waited.count());
  }
}

// Keeps as many fresh workers as the reserve has, and one for each blocked head.
void TaskServer::renew_workers(const std::string& device, int blocked) {
  const DeviceSlots slots = slots_of(device);
  Renewal& renewal = renewals_[device];
  const auto now = std::chrono::steady_clock::now();
  const auto since = std::max(renewal.blocked_since.value_or(now), renewal.replaced_at);
  const bool is_late = blocked > 0 && now - since > kReplacePeriod;
  const int coming =
      is_late ? 0 : std::max(0, config_.workers_per_device + reserve() - slots.connected);
  const std::vector<int64_t> replaced =
      workers_to_replace(slots.idle, isolation(), reserve() + blocked, coming);
  if (replaced.empty()) return;
  renewal.replaced_at = now;
  replace(replaced);
}

void TaskServer::replace(const std::vector<int64_t>& connections) {
  std::vector<int64_t> pids;
  {
    MutexLock lock(mutex_);
    for (const auto& connection : connections_) {
      const bool is_wanted = std::find(connections.begin(), connections.end(),
                                       connection->number) != connections.end();
      // It may have got a task since.
      if (!is_wanted || !connection->is_idle || connection->is_replaced) continue;
      connection->is_replaced = true;
      pids.push_back(connection->pid);
      context_.metrics.worker_replaced(connection->device);
    }
    ++work_epoch_;
    work_.notify_all();
  }
  for (const int64_t pid : pids) {
    log::info("worker is replaced", {{"pid", pid}});
    if (config_.replace_worker) config_.replace_worker(pid);
  }
}

}  // namespace voxeld
