#include "server/jobs/workers/task_server.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <utility>

#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/process/frame_socket.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

}  // namespace

Result<std::unique_ptr<TaskServer>> TaskServer::start(TaskServerConfig config,
                                                      TaskServerContext context) {
  std::error_code failed;
  remove_tree(config.scratch_root);  // what workers of an earlier daemon left
  fs::create_directories(config.scratch_root, failed);
  if (failed) return code_error("create directory", "scratch", failed);
  VOXELD_ASSIGN(UniqueFd listener, listen_unix(config.socket));
  return std::unique_ptr<TaskServer>(
      new TaskServer(std::move(config), std::move(context), std::move(listener)));
}

TaskServer::TaskServer(TaskServerConfig config, TaskServerContext context, UniqueFd listener)
    : config_(std::move(config)),
      context_(std::move(context)),
      listener_(std::move(listener)),
      dispatcher_(config_, context_),
      outputs_(config_, context_) {
  watch_ = std::make_unique<WorkerWatch>(
      WatchLimits{config_.limits.worker_memory_bytes_max,
                  config_.limits.all_workers_memory_bytes_max, config_.limits.job_seconds_max,
                  config_.limits.slice_silence_seconds_max},
      watch_calls());
  scratch_watch_ = std::make_unique<ScratchWatch>(config_.limits.scratch_bytes_max, context_.disk,
                                                  scratch_calls());
  // Last: an exception of what comes before must not meet a thread that runs.
  accept_thread_ = std::thread([this] { accept_loop(); });
}

TaskServer::~TaskServer() {
  stop();
}

void TaskServer::stop() {
  if (stopping_.exchange(true)) return;
  ::shutdown(listener_.get(), SHUT_RDWR);  // accept() returns
  dispatcher_.stop();
  if (accept_thread_.joinable()) accept_thread_.join();
  watch_.reset();
  scratch_watch_.reset();
  join_ended(true);
  ::unlink(config_.socket.c_str());
}

std::vector<WorkerState> TaskServer::workers() const {
  MutexLock lock(mutex_);
  std::vector<WorkerState> states;
  for (const Connection& connection : connections_) {
    WorkerState state = connection.session->state();
    if (state.connected) states.push_back(std::move(state));
  }
  for (const WorkerState& failed : failed_devices_) {
    const bool works = std::any_of(states.begin(), states.end(), [&](const WorkerState& state) {
      return state.device == failed.device;
    });
    if (!works) states.push_back(failed);
  }
  return states;
}

void TaskServer::device_failed(WorkerState state) {
  MutexLock lock(mutex_);
  std::erase_if(failed_devices_,
                [&](const WorkerState& known) { return known.device == state.device; });
  failed_devices_.push_back(std::move(state));
}

WorkerSessionContext TaskServer::session_context() {
  return {config_,
          context_,
          dispatcher_,
          outputs_,
          stopping_,
          [this](WorkerState state) { device_failed(std::move(state)); },
          [this](const std::string& device) { report_device(device); }};
}

void TaskServer::accept_loop() {
  while (!stopping_) {
    UniqueFd fd(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    if (fd.valid()) {
      guarded("a worker's connection", [&] { add_connection(std::move(fd)); });
    } else if (errno != EINTR && errno != ECONNABORTED && !stopping_) {
      // Out of descriptors, for one: those who hold them may let go.
      log::error("task socket cannot accept", {{"errno", errno}});
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    guarded("the task server", [this] { join_ended(false); });
  }
}

void TaskServer::add_connection(UniqueFd fd) {
  MutexLock lock(mutex_);
  const int64_t number = ++connections_made_;
  const fs::path folder = config_.scratch_root / ("w" + std::to_string(number));
  Connection& connection = connections_.emplace_back();
  try {
    connection.session =
        std::make_unique<WorkerSession>(number, std::move(fd), folder, session_context());
    connection.thread = std::thread([this, session = connection.session.get()] {
      const auto device = [&] { return session->state().device; };
      session->run();
      guarded("a worker's connection", [&] { report_device(device()); });
    });
  } catch (const std::exception&) {  // no memory, too many threads: the worker tries again
    connections_.pop_back();
    throw;
  }
}

void TaskServer::join_ended(bool all) {
  std::list<Connection> ended;
  {
    MutexLock lock(mutex_);
    for (auto it = connections_.begin(); it != connections_.end();) {
      const auto next = std::next(it);
      if (all) it->session->shutdown();
      if (all || it->session->has_ended()) ended.splice(ended.end(), connections_, it);
      it = next;
    }
  }
  for (Connection& connection : ended) connection.thread.join();
}

// --- the watches

WorkerWatch::Calls TaskServer::watch_calls() {
  return {[this] {
            context_.slices.charge_cpu();
            dispatcher_.look_who_waits();
            return watched();
          },
          [this](const WatchedWorker& worker, int64_t bytes) { measured(worker, bytes); },
          [this](const WatchedWorker& worker, const Error& error) {
            end_worker(worker, {error.message(), /*counts=*/true}, error);
          },
          [this](const WatchedWorker& worker, const WorkerLoss& loss) {
            end_worker(worker, loss, std::nullopt);
          },
          [this](const WatchedWorker& worker) { take_slice(worker); }};
}

ScratchWatch::Calls TaskServer::scratch_calls() {
  return {[this] { return watched_scratch(); },
          [this](const WatchedScratch& worker, const Error& error) {
            const bool counts = error.code != ErrorCode::kStorageFull;
            end_worker({.pid = worker.pid, .task = worker.task}, {error.message(), counts}, error);
          }};
}

std::vector<WatchedWorker> TaskServer::watched() const {
  std::vector<WatchedWorker> all;
  {
    MutexLock lock(mutex_);
    for (const Connection& connection : connections_) {
      if (auto worker = connection.session->watched()) all.push_back(*std::move(worker));
    }
  }
  for (WatchedWorker& worker : all) {
    if (worker.task.empty()) continue;
    worker.asked_bytes = context_.slices.granted_bytes(worker.task);
    worker.needed_bytes = context_.slices.needed_bytes(worker.task);
  }
  return all;
}

std::vector<WatchedScratch> TaskServer::watched_scratch() const {
  std::vector<WatchedScratch> all;
  MutexLock lock(mutex_);
  for (const Connection& connection : connections_) {
    if (auto worker = connection.session->watched_scratch()) all.push_back(*std::move(worker));
  }
  return all;
}

void TaskServer::measured(const WatchedWorker& worker, int64_t memory_bytes) {
  std::string device;
  {
    MutexLock lock(mutex_);
    for (const Connection& connection : connections_) {
      const WorkerState state = connection.session->state();
      if (state.pid != worker.pid) continue;
      connection.session->set_memory(memory_bytes);
      device = state.device;
    }
  }
  report_device(device);
}

void TaskServer::report_device(const std::string& device) const {
  if (device.empty()) return;
  int64_t bytes = 0;
  bool is_degraded = false;
  MutexLock lock(mutex_);
  for (const Connection& connection : connections_) {
    const WorkerState state = connection.session->state();
    if (!state.connected || state.device != device) continue;
    bytes += state.memory_bytes;
    is_degraded = is_degraded || !state.device_failure.empty();
  }
  context_.metrics.set_worker_memory(device, bytes);
  context_.metrics.set_degraded(device, is_degraded);
}

// A worker that is stopped or hangs keeps its task for a while yet, and the device no longer.
void TaskServer::take_slice(const WatchedWorker& worker) {
  if (!context_.slices.take_away(worker.task)) return;
  log::warn("a silent worker loses its time slice on the device",
            {{"job", worker.task}, {"pid", worker.pid}, {"seconds", worker.silent_seconds}});
}

void TaskServer::end_worker(const WatchedWorker& worker, const WorkerLoss& loss,
                            const std::optional<Error>& verdict) {
  log::warn("worker is ended",
            {{"job", worker.task}, {"pid", worker.pid}, {"reason", loss.reason}});
  MutexLock lock(mutex_);
  for (const Connection& connection : connections_) {
    connection.session->end(worker.pid, worker.task, loss, verdict);
  }
}

}  // namespace voxeld
