// The gateway's side of the task API: a Unix socket, one thread for each connected worker.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "proto/task_api.h"
#include "server/base/frame_socket.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/asset_store.h"
#include "server/jobs/frame_store.h"
#include "server/jobs/job_board.h"
#include "server/jobs/job_metrics.h"
#include "server/jobs/job_service.h"
#include "server/jobs/job_store.h"
#include "server/store/blob_store.h"

namespace voxeld {

struct TaskServerConfig {
  std::filesystem::path socket;        // DIR/run/tasks.sock
  std::filesystem::path scratch_root;  // a folder per connection is made here
  // How the process ended ("signal 9 (Killed)"), waiting a moment for it; empty: unknown.
  std::function<std::string(int64_t pid)> exit_reason;
  std::function<void(int64_t pid)> kill_worker;
  TaskLimits limits;
  std::function<TenantLimits(std::string_view tenant)> limits_of;  // null: none
};

// What the connections work on; all of it outlives the server.
struct TaskServerContext {
  JobStore& jobs;
  AssetStore& assets;
  FrameStore& frames;
  BlobStore& blobs;
  JobBoard& board;
  JobMetrics& metrics;
  std::function<void(const JobRecord&)> job_changed;  // after each durable change
};

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
  void notify_work();
  // Connected workers, and devices that could not be opened last time they were tried.
  std::vector<WorkerState> workers() const;

 private:
  struct Connection;
  TaskServer(TaskServerConfig config, TaskServerContext context, UniqueFd listener);
  void accept_loop();
  void add_connection(UniqueFd fd);
  void join_ended(bool all);

  void serve(Connection& connection);
  Status greet(Connection& connection);
  Status answer(Connection& connection, const std::string& frame);
  Status give_task(Connection& connection);
  Result<Task> make_task(const JobRecord& record);
  Status send_task(Connection& connection, const JobRecord& record, const Task& task);
  Status refuse_task(const JobRecord& record, const Error& error);
  std::string overdue(Connection& connection, const TaskProgress& progress, double cancel_age);
  Status take_progress(Connection& connection, const nlohmann::json& message);
  Status take_frame(Connection& connection, const nlohmann::json& message);
  Result<std::optional<BlobInfo>> adopt_frame(Connection& connection, const TaskFrame& frame);
  Status take_completion(Connection& connection, const nlohmann::json& message);
  Status take_failure(Connection& connection, const nlohmann::json& message);
  Result<std::optional<JobRecord>> end_completed(const Connection& connection,
                                                 TaskCompletion completion);
  Status adopt_outputs(const Connection& connection, const TaskCompletion& completion,
                       std::map<std::string, BlobInfo>& adopted, FinishedTask& finished);
  TenantLimits limits_of(std::string_view task);
  void put_back(Connection& connection, const Error& why);
  void end_task(Connection& connection, const JobRecord& record);
  bool wait_for_work(uint64_t seen) EXCLUDES(mutex_);

  const TaskServerConfig config_;
  const TaskServerContext context_;
  UniqueFd listener_;
  std::atomic<bool> stopping_{false};
  std::thread accept_thread_;

  mutable Mutex mutex_;
  CondVar work_;
  uint64_t work_epoch_ GUARDED_BY(mutex_) = 0;
  int64_t connections_made_ GUARDED_BY(mutex_) = 0;
  std::list<std::unique_ptr<Connection>> connections_ GUARDED_BY(mutex_);
  std::vector<WorkerState> failed_devices_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
