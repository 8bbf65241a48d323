// The gateway's side of the task API: a Unix socket, one thread for each connection of a worker.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/task_api.h"
#include "server/base/frame_socket.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/events/job_board.h"
#include "server/jobs/events/job_metrics.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/frame_store.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/scheduling/slots.h"
#include "server/jobs/scheduling/time_slices.h"
#include "server/jobs/scheduling/worker_isolation.h"
#include "server/jobs/workers/scratch_watch.h"
#include "server/jobs/workers/worker_files.h"
#include "server/jobs/workers/worker_watch.h"
#include "server/store/blob_store.h"
#include "server/store/part_store.h"

namespace voxeld {

struct TaskServerConfig {
  std::filesystem::path socket;        // DIR/run/tasks.sock
  std::filesystem::path scratch_root;  // a folder per connection is made here
  // How the process ended ("signal 9 (Killed)"), waiting a moment for it; empty: unknown.
  std::function<std::string(int64_t pid)> exit_reason;
  std::function<void(int64_t pid)> kill_worker;
  // Ends an idle worker; another one starts in its place. null: its connection closes, no more.
  std::function<void(int64_t pid)> replace_worker;
  std::function<WorkerIsolation()> isolation;  // asked before each claim; null: kNone
  // Tasks of a device that run at a time, where it has more processes: `reserve` tells by how many.
  int workers_per_device = 1;
  std::function<int()> reserve;             // null: 0
  std::function<int(int64_t pid)> slot_of;  // among the device's processes; null: 0
  // A worker that has opened its device is there.
  std::function<void(const std::string& device)> on_connected;
  bool is_fair = true;  // false: jobs are claimed as they arrived
  // That a queued job will take, as it is estimated; 0: not known. null: never known.
  std::function<double(const std::string& job)> expected_seconds;
  TaskLimits limits;
  std::function<TenantLimits(std::string_view tenant)> limits_of;  // null: none
};

// The parts of the service that connections work on; all of them outlive the server.
struct TaskServerContext {
  JobStore& jobs;
  AssetStore& assets;
  FrameStore& frames;
  BlobStore& blobs;
  PartStore& parts;
  JobBoard& board;
  JobMetrics& metrics;
  DeviceTurns& turns;
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

  void serve(Connection& connection) noexcept;
  Status converse(Connection& connection);
  Result<nlohmann::json> receive_first(Connection& connection);
  void blame(Connection& connection, const Error& error) EXCLUDES(mutex_);
  void end_worker(Connection& connection) noexcept EXCLUDES(mutex_);
  Status greet(Connection& connection, const nlohmann::json& message);
  void note_connected(Connection& connection, const WorkerHello& hello) EXCLUDES(mutex_);
  Status answer(Connection& connection, const std::string& frame);
  // --- task_claims.cpp
  Status give_task(Connection& connection);
  uint64_t work_epoch() const EXCLUDES(mutex_);
  void begin_waiting(Connection& connection) EXCLUDES(mutex_);
  void end_waiting(Connection& connection) EXCLUDES(mutex_);
  std::optional<JobRecord> take_assigned(Connection& connection) EXCLUDES(mutex_);
  void wait_for_work(const Connection& connection, uint64_t seen) EXCLUDES(mutex_);
  // Claims jobs for those workers of the device that wait. is_poll: also where nothing changed.
  void assign_jobs(const std::string& device, bool is_poll) EXCLUDES(claim_mutex_, mutex_);
  struct DeviceSlots;
  DeviceSlots slots_of(const std::string& device) const EXCLUDES(mutex_);
  size_t free_slots(const DeviceSlots& slots) const;
  HeadChoice choose_head(const std::string& device, const DeviceSlots& slots,
                         const std::vector<QueueHead>& heads);
  bool assign(std::vector<IdleSlot> idle, const JobRecord& record) EXCLUDES(mutex_);
  bool is_replaced(const Connection& connection) const EXCLUDES(mutex_);
  bool put_back_unassigned() REQUIRES(claim_mutex_);
  static std::set<std::string, std::less<>> tenants_of(const std::vector<QueueHead>& heads);
  // --- task_isolation.cpp
  WorkerIsolation isolation() const;
  int reserve() const;
  bool is_free_slot_left() const REQUIRES(mutex_);
  // `blocked`: heads of the queue that wait for fresh workers.
  void note_blocked(const std::string& device, std::optional<int> blocked) REQUIRES(claim_mutex_);
  void renew_workers(const std::string& device, int blocked) REQUIRES(claim_mutex_)
      EXCLUDES(mutex_);
  void replace(const std::vector<int64_t>& connections) EXCLUDES(mutex_);
  // --- task_parking.cpp
  // Takes what a report says of it, and looks who waits for a worker.
  bool is_told_to_park(Connection& connection, const TaskProgress& progress) EXCLUDES(mutex_);
  bool is_time_to_look(const std::string& device) EXCLUDES(mutex_);
  std::vector<Connection*> busy_workers(const std::string& device, std::vector<StartedJob>& started)
      REQUIRES(mutex_);
  void look_for_waiting(const std::string& device) EXCLUDES(mutex_);
  Status take_park(Connection& connection, const nlohmann::json& message);
  // --- task_claims.cpp
  Result<Task> make_task(const WorkerFiles& files, const JobRecord& record);
  Status add_done(const WorkerFiles& files, const JobRecord& record, Task& task);
  Result<std::string> hand_over(const WorkerFiles& files, std::string_view id,
                                std::string_view what);
  Status send_task(Connection& connection, const JobRecord& record, const Task& task);
  Status refuse_task(const JobRecord& record, const Error& error);
  double stop_age_seconds(Connection& connection);
  LiveJob live(const std::string& task) const;
  std::string overdue(Connection& connection, const TaskProgress& progress, double cancel_age);
  Status take_progress(Connection& connection, const nlohmann::json& message);
  Status take_frame(Connection& connection, const nlohmann::json& message);
  Result<std::optional<BlobInfo>> adopt_frame(Connection& connection, const TaskFrame& frame);
  Status take_part(Connection& connection, const nlohmann::json& message);
  Status take_completion(Connection& connection, const nlohmann::json& message);
  Status take_failure(Connection& connection, const nlohmann::json& message);
  Result<std::optional<JobRecord>> end_completed(const Connection& connection,
                                                 TaskCompletion completion);
  Status adopt_outputs(const Connection& connection, const TaskCompletion& completion,
                       std::map<std::string, BlobInfo>& adopted, FinishedTask& finished);
  TenantLimits limits_of(std::string_view task);
  void put_back(Connection& connection, const Error& why) noexcept;
  std::string lost_reason(Connection& connection, const Error& why, bool counts);
  WorkerWatch::Calls watch_calls();
  std::vector<WatchedWorker> watched() const EXCLUDES(mutex_);
  // --- task_server_scratch.cpp
  static WatchedScratch scratch_of(const Connection& connection);
  std::vector<WatchedScratch> watched_scratch() const EXCLUDES(mutex_);
  ScratchWatch::Calls scratch_calls();
  int64_t memory_of(const std::string& device) const REQUIRES(mutex_);
  void measured(const WatchedWorker& worker, int64_t memory_bytes) EXCLUDES(mutex_);
  void take_turn(const WatchedWorker& worker);
  // Kills it; its job fails with the verdict or, without one, is put back.
  void end_worker(const WatchedWorker& worker, const std::string& reason,
                  const std::optional<Error>& verdict) EXCLUDES(mutex_);
  Result<std::optional<JobRecord>> end_lost(Connection& connection, const std::string& task,
                                            const std::string& reason, bool counts);
  void end_task(Connection& connection, const JobRecord& record);

  const TaskServerConfig config_;
  const TaskServerContext context_;
  UniqueFd listener_;
  std::atomic<bool> stopping_{false};
  std::thread accept_thread_;

  // One thread claims at a time, before mutex_.
  Mutex claim_mutex_;
  // By device: the work_epoch_ after which its workers have looked into the queue.
  std::map<std::string, uint64_t> claimed_epoch_ GUARDED_BY(claim_mutex_);
  std::optional<JobRecord> unassigned_ GUARDED_BY(claim_mutex_);  // claimed, and nobody's task yet
  // By device: since when a head of the queue waits for a fresh worker, and when one was last
  // replaced.
  struct Renewal {
    std::optional<std::chrono::steady_clock::time_point> blocked_since;
    std::chrono::steady_clock::time_point replaced_at{};
  };
  std::map<std::string, Renewal> renewals_ GUARDED_BY(claim_mutex_);

  mutable Mutex mutex_;
  CondVar work_;
  uint64_t work_epoch_ GUARDED_BY(mutex_) = 0;
  // By device: when its busy workers have last looked who waits.
  std::map<std::string, std::chrono::steady_clock::time_point> looked_at_ GUARDED_BY(mutex_);
  int64_t connections_made_ GUARDED_BY(mutex_) = 0;
  int64_t tasks_ended_ GUARDED_BY(mutex_) = 0;
  std::list<std::unique_ptr<Connection>> connections_ GUARDED_BY(mutex_);
  std::vector<WorkerState> failed_devices_ GUARDED_BY(mutex_);
  std::unique_ptr<WorkerWatch> watch_;  // last: both use all of the above
  std::unique_ptr<ScratchWatch> scratch_watch_;
};

}  // namespace voxeld
