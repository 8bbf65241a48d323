// The task server's end of the watch over what workers write.
#include "server/jobs/workers/task_connection.h"
#include "server/jobs/workers/task_server.h"

namespace voxeld {

WatchedScratch TaskServer::scratch_of(const Connection& connection) {
  const WorkerFolders folders = connection.files.folders();
  return {connection.pid, "", {folders.scratch_dir, folders.cache_dir}};
}

std::vector<WatchedScratch> TaskServer::watched_scratch() const {
  std::vector<WatchedScratch> all;
  MutexLock lock(mutex_);
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (!connection->state.connected || connection->state.task.empty()) continue;
    const WorkerFolders folders = connection->files.folders();
    all.push_back(
        {connection->state.pid, connection->state.task, {folders.scratch_dir, folders.cache_dir}});
  }
  return all;
}

ScratchWatch::Calls TaskServer::scratch_calls() {
  return {[this] { return watched_scratch(); },
          [this](const WatchedScratch& worker, const Error& error) {
            end_worker({.pid = worker.pid, .task = worker.task}, error.message(), error);
          }};
}

}  // namespace voxeld
