// The task server's ends of the watch: which workers there are, what they take, which has to go.
#include "server/base/log.h"
#include "server/jobs/task_connection.h"
#include "server/jobs/task_server.h"

namespace voxeld {

WorkerWatch::Calls TaskServer::watch_calls() {
  return {[this] { return watched(); },
          [this](const WatchedWorker& worker, int64_t bytes) { measured(worker, bytes); },
          [this](const WatchedWorker& worker, const Error& error) { condemn(worker, error); }};
}

std::vector<WatchedWorker> TaskServer::watched() const {
  MutexLock lock(mutex_);
  std::vector<WatchedWorker> all;
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (!connection->state.connected) continue;
    all.push_back(
        {connection->state.pid, connection->state.task, connection->task_age.ms() / 1000.0});
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

// The connection ends, too, where the process cannot be killed from here.
void TaskServer::condemn(const WatchedWorker& worker, const Error& error) {
  log::warn("worker is ended",
            {{"job", worker.task}, {"pid", worker.pid}, {"reason", error.message()}});
  MutexLock lock(mutex_);
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (connection->state.pid != worker.pid || connection->state.task != worker.task) continue;
    connection->verdict = error;
    if (config_.kill_worker) config_.kill_worker(worker.pid);
    connection->socket.shutdown();
  }
}

}  // namespace voxeld
