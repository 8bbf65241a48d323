// The session of one worker: its connection of the task API (proto/messages/task_api.h), on a
// thread of its own. A connection for time slices is one, too (slice_server.h).
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include <nlohmann/json_fwd.hpp>

#include "proto/messages/task_api.h"
#include "server/base/clock.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/workers/dispatcher.h"
#include "server/jobs/workers/message_rate.h"
#include "server/jobs/workers/output_adopter.h"
#include "server/jobs/workers/scratch_watch.h"
#include "server/jobs/workers/task_context.h"
#include "server/jobs/workers/worker_files.h"
#include "server/jobs/workers/worker_watch.h"
#include "server/process/frame_socket.h"

namespace voxeld {

// The parts of the server that a session uses; all of them outlive it.
struct WorkerSessionContext {
  const TaskServerConfig& config;
  const TaskServerContext& parts;
  Dispatcher& dispatcher;
  OutputAdopter& outputs;
  const std::atomic<bool>& stopping;
  // A worker could not open its device; its process ends next. On the session's thread.
  std::function<void(WorkerState)> device_failed;
  // A worker's device_failure changed. On the session's thread.
  std::function<void(const std::string& device)> device_changed;
};

// run() and what it calls belong to the session's thread; the other public calls are thread-safe.
class WorkerSession {
 public:
  WorkerSession(int64_t number, UniqueFd connection, std::filesystem::path folder,
                const WorkerSessionContext& context);

  // Serves the worker until it leaves, breaks the protocol or the gateway stops. Any failure ends
  // only this session, and its task is put back.
  void run() noexcept;
  bool has_ended() const { return has_ended_; }
  // Ends the connection, and so the session.
  void shutdown() { socket_.shutdown(); }

  WorkerState state() const EXCLUDES(mutex_);
  // nullopt: not connected, or, of the scratch, without a task.
  std::optional<WatchedWorker> watched() const EXCLUDES(mutex_);
  std::optional<WatchedScratch> watched_scratch() const EXCLUDES(mutex_);
  void set_memory(int64_t bytes) EXCLUDES(mutex_);
  // Kills the process and ends the session where it has this process and task. Its job fails with
  // the verdict or, without one, is put back.
  void end(int64_t pid, const std::string& task, const WorkerLoss& loss,
           const std::optional<Error>& verdict) EXCLUDES(mutex_);

 private:
  using Json = nlohmann::json;

  // --- the conversation
  Status converse();
  Result<Json> receive_first();
  Status greet(const Json& message);
  void enter(const WorkerHello& hello) EXCLUDES(mutex_);  // it has opened its device
  void leave() noexcept EXCLUDES(mutex_);
  Result<std::string> receive() EXCLUDES(mutex_);
  Status handle(const std::string& frame);
  Status send(const Json& message);
  // Logs why the session ends, and kills a worker that breaks the protocol.
  void blame(const Error& error);
  void kill(int64_t pid) const;

  // --- messages
  Status give_task();
  Status send_task(const JobRecord& record, const Task& task);
  void wait_for_memory(const JobRecord& record);
  Status refuse_task(const JobRecord& record, const Error& error);
  Status take_progress(const Json& message);
  Result<std::string> hand_over(const std::string& grid) const;
  Status take_frame(const Json& message);
  Status take_part(const Json& message);
  Status take_completion(const Json& message);
  Status take_failure(const Json& message);
  Status take_device_failure(const Error& error);
  Status take_preemption(const Json& message);

  // --- the task
  std::string task() const EXCLUDES(mutex_);
  bool is_mine(const std::string& task_id, int64_t fence) const;
  void set_task(std::string id, int64_t fence) EXCLUDES(mutex_);
  void end_task(const JobRecord& record);
  // Why a worker that still reports has to go; empty while all is well.
  std::string overdue(const TaskProgress& progress, double stop_age);
  // For how long nobody has wanted the task's result any more; negative: it is wanted.
  double stop_age_seconds() const;
  void put_back(const Error& why) noexcept;
  // How the task is lost, as far as is known without waiting.
  WorkerLoss loss_of_task(const Error& why) const EXCLUDES(mutex_);
  std::string lost_reason(const Error& why, const WorkerLoss& loss);
  Result<std::optional<JobRecord>> end_lost(const std::string& task_id, const WorkerLoss& loss);

  const int64_t number_;
  const WorkerSessionContext context_;
  FrameSocket socket_;
  MessageRate rate_;
  const WorkerFiles files_;
  std::atomic<bool> has_ended_{false};

  // Used by the session's thread alone.
  std::string device_;
  int64_t pid_ = 0;
  int64_t fence_ = 0;
  std::string input_;                  // hash, of the task
  std::string tenant_;                 // of the task
  bool has_worker_ = false;            // the task was sent
  int64_t deadline_ms_ = kNoDeadline;  // of the task
  TaskProgress progress_;              // the last report that said something new …
  Stopwatch since_progress_;           // … and its age
  std::string kill_reason_;            // why the session killed the worker, once it did

  mutable Mutex mutex_;
  WorkerState state_ GUARDED_BY(mutex_);
  Stopwatch task_age_ GUARDED_BY(mutex_);
  bool was_displaced_ GUARDED_BY(mutex_) = false;       // the job, before
  std::optional<Error> verdict_ GUARDED_BY(mutex_);     // of a watch, on the task that runs
  std::optional<WorkerLoss> ended_ GUARDED_BY(mutex_);  // by a watch, for the task that runs
  // Since when the gateway waits for its next message; nullopt while it works on one.
  std::optional<Stopwatch> silence_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
