// The task server's ends of the watch: which workers there are, what they take, which has to go.
#include <algorithm>
#include <cmath>

#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/jobs/workers/task_connection.h"
#include "server/jobs/workers/task_server.h"

namespace voxeld {

WorkerWatch::Calls TaskServer::watch_calls() {
  return {[this] {
            context_.turns.charge_cpu();
            return watched();
          },
          [this](const WatchedWorker& worker, int64_t bytes) { measured(worker, bytes); },
          [this](const WatchedWorker& worker, const Error& error) {
            end_worker(worker, error.message(), error);
          },
          [this](const WatchedWorker& worker, const std::string& reason) {
            end_worker(worker, reason, std::nullopt);
          },
          [this](const WatchedWorker& worker) { take_turn(worker); }};
}

std::vector<WatchedWorker> TaskServer::watched() const {
  std::vector<WatchedWorker> all;
  {
    MutexLock lock(mutex_);
    for (const auto& connection : connections_) {
      MutexLock inner(connection->mutex);
      if (!connection->state.connected) continue;
      all.push_back(
          {.pid = connection->state.pid,
           .task = connection->state.task,
           .task_seconds = connection->task_age.ms() / 1000.0,
           .silent_seconds = connection->silence ? connection->silence->ms() / 1000.0 : 0.0});
    }
  }
  for (WatchedWorker& worker : all) {
    if (!worker.task.empty()) worker.asked_bytes = context_.turns.granted_bytes(worker.task);
  }
  return all;
}

int64_t TaskServer::memory_of(const std::string& device) const {
  int64_t bytes = 0;
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (!connection->state.connected || connection->state.device != device) continue;
    bytes += connection->state.memory_bytes;
  }
  return bytes;
}

void TaskServer::measured(const WatchedWorker& worker, int64_t memory_bytes) {
  MutexLock lock(mutex_);
  std::string device;
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (connection->state.pid != worker.pid) continue;
    connection->state.memory_bytes = memory_bytes;
    device = connection->state.device;
  }
  if (!device.empty()) context_.metrics.set_worker_memory(device, memory_of(device));
}

// A worker that is stopped or hangs keeps its task for a while yet, and the device no longer.
void TaskServer::take_turn(const WatchedWorker& worker) {
  if (!context_.turns.take_away(worker.task)) return;
  log::warn("a silent worker loses its turn on the device",
            {{"job", worker.task}, {"pid", worker.pid}, {"seconds", worker.silent_seconds}});
}

// The connection ends, too, where the process cannot be killed from here.
void TaskServer::end_worker(const WatchedWorker& worker, const std::string& reason,
                            const std::optional<Error>& verdict) {
  log::warn("worker is ended", {{"job", worker.task}, {"pid", worker.pid}, {"reason", reason}});
  MutexLock lock(mutex_);
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (connection->state.pid != worker.pid || connection->state.task != worker.task) continue;
    connection->ended_for = reason;
    connection->verdict = verdict;
    if (config_.kill_worker) config_.kill_worker(worker.pid);
    connection->socket.shutdown();
  }
}

// Why a worker that still reports has to go; empty while all is well.
std::string TaskServer::overdue(Connection& connection, const TaskProgress& progress,
                                double cancel_age) {
  const TaskProgress& last = connection.progress;
  if (progress.stage != last.stage || progress.tiles_done != last.tiles_done ||
      progress.tiles_total != last.tiles_total || progress.frames_done != last.frames_done ||
      progress.frames_total != last.frames_total) {
    connection.progress = progress;
    connection.since_progress.lap();
  }
  const auto seconds = [](double value) { return std::to_string(std::lround(value)) + " s"; };
  if (cancel_age > config_.limits.cancel_seconds_max) {
    return "ignored a cancel for " + seconds(cancel_age);
  }
  // A task that waits for a slice or memory, or prepares, reports no progress; it is not stalled.
  if (context_.turns.is_waiting(progress.task)) connection.since_progress.lap();
  if (connection.since_progress.ms() > config_.limits.stall_seconds_max * 1000.0) {
    return "no progress in stage " + progress.stage + " for " +
           seconds(connection.since_progress.ms() / 1000.0);
  }
  return "";
}

// For how long nobody has wanted the task's result any more; negative: it is wanted.
double TaskServer::stop_age_seconds(Connection& connection) {
  const double cancelled = context_.board.cancel_age_seconds(connection.task());
  const int64_t late_ms = unix_time_ms() - connection.deadline_at_ms;
  if (connection.deadline_at_ms == 0 || late_ms < 0) return cancelled;
  return std::max(cancelled, static_cast<double>(late_ms) / 1000.0);
}

}  // namespace voxeld
