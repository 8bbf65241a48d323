// The task server's side of parking: who waits for a worker, who is asked to give up theirs.
#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/jobs/scheduling/preemption.h"
#include "server/jobs/workers/task_connection.h"

namespace voxeld {
namespace {

// A device's queue is looked at so often while all of its workers are busy.
constexpr std::chrono::milliseconds kLookPeriod{100};

}  // namespace

std::set<std::string, std::less<>> TaskServer::tenants_of(const std::vector<QueueHead>& heads) {
  std::set<std::string, std::less<>> tenants;
  for (const QueueHead& head : heads) tenants.insert(head.tenant);
  return tenants;
}

bool TaskServer::is_told_to_park(Connection& connection, const TaskProgress& progress) {
  {
    MutexLock lock(mutex_);
    if (!connection.started) return false;
    connection.started->can_park = progress.can_park;
    connection.started->preparation_seconds = static_cast<double>(progress.preparation_ms) / 1000.0;
  }
  look_for_waiting(connection.device);
  MutexLock lock(mutex_);
  return connection.started && connection.started->is_asked;
}

// A tenant without a worker gets one where a slot is free on any device.
bool TaskServer::is_time_to_look(const std::string& device) {
  MutexLock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  auto& looked_at = looked_at_[device];
  if (now - looked_at < kLookPeriod) return false;
  looked_at = now;
  return !is_free_slot_left();
}

// The jobs that workers of the device have, with what is known of them now.
std::vector<TaskServer::Connection*> TaskServer::busy_workers(const std::string& device,
                                                              std::vector<StartedJob>& started) {
  const auto now = std::chrono::steady_clock::now();
  std::vector<Connection*> busy;
  for (const auto& connection : connections_) {
    if (!connection->started || connection->device != device) continue;
    StartedJob job = *connection->started;
    job.slot_seconds = std::chrono::duration<double>(now - connection->started_at).count();
    const int64_t device_us = context_.turns.device_us(connection->task());
    job.device_seconds += static_cast<double>(device_us) / 1e6;
    started.push_back(std::move(job));
    busy.push_back(connection.get());
  }
  return busy;
}

void TaskServer::look_for_waiting(const std::string& device) {
  if (!config_.is_fair || !is_time_to_look(device)) return;
  const auto heads = context_.jobs.queue_heads();
  if (!heads) return;  // claims tell of it
  context_.turns.set_queued(device, tenants_of(*heads));
  std::vector<StartedJob> started;
  MutexLock lock(mutex_);
  const std::vector<Connection*> busy = busy_workers(device, started);
  const ParkingView view{
      *heads,
      started,
      [&](const std::string& tenant) { return context_.turns.share(device, tenant); },
      [&](const std::string& tenant) {
        return static_cast<double>(context_.turns.weight_of(tenant));
      },
      [&](const std::string& job) {
        return config_.expected_seconds ? config_.expected_seconds(job) : 0.0;
      },
      unix_time_ms()};
  const std::vector<size_t> parked = jobs_to_park(view);
  for (size_t i = 0; i < busy.size(); ++i) {
    const bool is_asked = std::find(parked.begin(), parked.end(), i) != parked.end();
    busy[i]->started->is_asked = is_asked;
    busy[i]->was_asked |= is_asked;
  }
}

Status TaskServer::take_park(Connection& connection, const nlohmann::json& message) {
  VOXELD_ASSIGN(const TaskPark park, parse_task_park(message));
  const auto send = [&](const char* answer) {
    return connection.socket.send(nlohmann::json{{answer, true}}.dump());
  };
  if (park.task != connection.task() || park.fence != connection.fence) return send("fenced");
  {
    MutexLock lock(mutex_);
    if (!connection.was_asked) {
      return Error{ErrorCode::kBadRequest, "a task was parked", "only where it was asked for",
                   park.task};
    }
  }
  VOXELD_ASSIGN(const auto parked, context_.jobs.park(park, live(park.task)));
  if (!parked) return send("fenced");
  end_task(connection, *parked);
  notify_work();
  return send("ok");
}

}  // namespace voxeld
