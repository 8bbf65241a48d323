// The gateway's side of the task API: a Unix socket, a session with a thread for each connection of
// a worker (worker_session.h), and the watches over all workers.
#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/thread_annotations.h"
#include "server/jobs/workers/dispatcher.h"
#include "server/jobs/workers/output_adopter.h"
#include "server/jobs/workers/scratch_watch.h"
#include "server/jobs/workers/task_context.h"
#include "server/jobs/workers/worker_session.h"
#include "server/jobs/workers/worker_watch.h"

namespace voxeld {

// Thread-safe. A connection that ends puts its task back at once.
class TaskServer {
 public:
  static Result<std::unique_ptr<TaskServer>> start(TaskServerConfig config,
                                                   TaskServerContext context);
  // As stop().
  ~TaskServer();
  // Closes every connection; tasks are put back without counting the attempt.
  void stop();
  // A job was queued: wakes a worker that waits for one.
  void notify_work() { dispatcher_.notify_work(); }
  // Connected workers, and devices that could not be opened last time they were tried.
  std::vector<WorkerState> workers() const EXCLUDES(mutex_);

 private:
  struct Connection {
    std::unique_ptr<WorkerSession> session;
    std::thread thread;
  };
  TaskServer(TaskServerConfig config, TaskServerContext context, UniqueFd listener);
  void accept_loop();
  void add_connection(UniqueFd fd) EXCLUDES(mutex_);
  void join_ended(bool all) EXCLUDES(mutex_);
  void device_failed(WorkerState state) EXCLUDES(mutex_);
  WorkerSessionContext session_context();

  // --- the watches, on their threads
  WorkerWatch::Calls watch_calls();
  ScratchWatch::Calls scratch_calls();
  std::vector<WatchedWorker> watched() const EXCLUDES(mutex_);
  std::vector<WatchedScratch> watched_scratch() const EXCLUDES(mutex_);
  void measured(const WatchedWorker& worker, int64_t memory_bytes) EXCLUDES(mutex_);
  // Sets the metrics of the device's workers together.
  void report_device(const std::string& device) const EXCLUDES(mutex_);
  void take_slice(const WatchedWorker& worker);
  void end_worker(const WatchedWorker& worker, const WorkerLoss& loss,
                  const std::optional<Error>& verdict) EXCLUDES(mutex_);

  const TaskServerConfig config_;
  const TaskServerContext context_;
  UniqueFd listener_;
  std::atomic<bool> stopping_{false};
  Dispatcher dispatcher_;
  OutputAdopter outputs_;
  std::thread accept_thread_;

  mutable Mutex mutex_;
  int64_t connections_made_ GUARDED_BY(mutex_) = 0;
  std::list<Connection> connections_ GUARDED_BY(mutex_);
  std::vector<WorkerState> failed_devices_ GUARDED_BY(mutex_);
  std::unique_ptr<WorkerWatch> watch_;  // last: both use all of the above
  std::unique_ptr<ScratchWatch> scratch_watch_;
};

}  // namespace voxeld
