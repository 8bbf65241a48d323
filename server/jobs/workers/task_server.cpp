
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "server/base/clock.h"
#include "server/base/directory.h"
#include "server/base/file.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/records/job_rows.h"
#include "server/jobs/workers/slice_server.h"
#include "server/jobs/workers/task_connection.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kHelloSecondsMax = 30.0;  // a busy machine opens a device in seconds
// Duration of one message, from its first byte until the worker has taken the reply.
constexpr double kMessageSecondsMax = 10.0;
// A worker with a turn that is silent for so long loses the turn: others have the device.
constexpr double kTurnSilenceSecondsMax = 2.0;
// Part of the reported device memory that tasks may use; drivers and other processes need some.
constexpr double kDeviceMemoryShare = 0.75;

double message_seconds_max(const TaskLimits& limits) {
  return std::min(kMessageSecondsMax, limits.silence_seconds_max);
}

std::string dump(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

// Empty where it has none.
std::string type_of(const json& message) {
  const auto type = message.is_object() ? message.find("type") : message.end();
  return type != message.end() && type->is_string() ? type->get<std::string>() : std::string();
}

// Device memory as the worker found it; 0 if the device does not report it.
int64_t device_memory(const std::string& device_json) {
  const json device = json::parse(device_json, nullptr, false);
  const auto bytes = device.is_object() ? device.find("memory_bytes") : device.end();
  if (bytes == device.end() || !bytes->is_number_integer()) return 0;
  const auto told =
      std::clamp(bytes->get<double>(), 0.0, static_cast<double>(limits::kMemoryBytesMax));
  return static_cast<int64_t>(told * kDeviceMemoryShare);
}

Error protocol_error(std::string detail, std::string expected, std::string got) {
  return {ErrorCode::kBadRequest, std::move(detail), std::move(expected), std::move(got)};
}

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
    : config_(std::move(config)), context_(std::move(context)), listener_(std::move(listener)) {
  // In the body: the thread uses members that are declared after it.
  accept_thread_ = std::thread([this] { accept_loop(); });
  watch_ = std::make_unique<WorkerWatch>(
      WatchLimits{config_.limits.worker_memory_bytes_max,
                  config_.limits.all_workers_memory_bytes_max, config_.limits.job_seconds_max,
                  kTurnSilenceSecondsMax},
      watch_calls());
  scratch_watch_ = std::make_unique<ScratchWatch>(config_.limits.scratch_bytes_max,
                                                  context_.blobs.disk(), scratch_calls());
}

TaskServer::~TaskServer() {
  stop();
}

void TaskServer::stop() {
  if (stopping_.exchange(true)) return;
  ::shutdown(listener_.get(), SHUT_RDWR);  // accept() returns
  notify_work();
  if (accept_thread_.joinable()) accept_thread_.join();
  watch_.reset();
  scratch_watch_.reset();
  join_ended(true);
  ::unlink(config_.socket.c_str());
}

void TaskServer::notify_work() {
  MutexLock lock(mutex_);
  ++work_epoch_;
  work_.notify_all();
}

std::vector<WorkerState> TaskServer::workers() const {
  MutexLock lock(mutex_);
  std::vector<WorkerState> states;
  for (const auto& connection : connections_) {
    MutexLock inner(connection->mutex);
    if (connection->state.connected) states.push_back(connection->state);
  }
  for (const WorkerState& failed : failed_devices_) {
    const bool works = std::any_of(states.begin(), states.end(), [&](const WorkerState& state) {
      return state.device == failed.device;
    });
    if (!works) states.push_back(failed);
  }
  return states;
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
  auto made = std::make_unique<Connection>(number, std::move(fd), folder,
                                           message_seconds_max(config_.limits));
  Connection& connection = *made;
  connections_.push_back(std::move(made));
  try {
    connection.thread = std::thread([this, &connection] {
      serve(connection);
      connection.ended = true;
    });
  } catch (const std::exception&) {  // no memory, too many threads: the worker tries again
    connections_.pop_back();
    throw;
  }
}

void TaskServer::join_ended(bool all) {
  std::list<std::unique_ptr<Connection>> ended;
  {
    MutexLock lock(mutex_);
    for (auto it = connections_.begin(); it != connections_.end();) {
      const auto next = std::next(it);
      if (all) (*it)->socket.shutdown();
      if (all || (*it)->ended) ended.splice(ended.end(), connections_, it);
      it = next;
    }
  }
  for (auto& connection : ended) connection->thread.join();
}

Status TaskServer::converse(Connection& connection) {
  VOXELD_ASSIGN(const json first, receive_first(connection));
  if (type_of(first) == "turns") {
    VOXELD_ASSIGN(const TurnsHello worker, parse_turns_hello(first));
    connection.device = worker.device;
    connection.pid = worker.pid;
    return serve_turns(connection.socket, worker, {context_.turns, context_.board, stopping_});
  }
  VOXELD_TRY(greet(connection, first));
  while (!stopping_) {
    VOXELD_ASSIGN(const std::string frame, connection.receive());
    VOXELD_TRY(connection.rate.take());
    VOXELD_TRY(answer(connection, frame));
  }
  return {};
}

// Whatever goes wrong ends this connection alone, and its task is put back.
void TaskServer::serve(Connection& connection) noexcept {
  Status status;
  try {
    status = converse(connection);
  } catch (const std::exception& failure) {
    status = exception_error(failure);
  }
  guarded("a worker's connection", [&] {
    if (!status && status.error().code != ErrorCode::kGone && !stopping_) {
      blame(connection, status.error());
    }
  });
  put_back(connection, status ? Error{} : std::move(status).error());
  connection.socket.shutdown();  // a worker that broke the protocol must notice
  end_worker(connection);
}

// Logs why a connection ends. A worker that breaks the protocol may belong to the file that it
// reads: its process ends too, and is replaced.
void TaskServer::blame(Connection& connection, const Error& error) {
  const bool is_broken =
      error.code == ErrorCode::kBadRequest || error.code == ErrorCode::kPayloadTooLarge;
  std::string tenant;
  {
    MutexLock lock(mutex_);
    if (connection.started) tenant = connection.started->tenant;
  }
  log::warn(is_broken ? "worker breaks the task protocol" : "worker connection ends",
            {{"device", connection.device},
             {"pid", connection.pid},
             {"job", connection.task()},
             {"tenant", tenant},
             {"error", error.message()}});
  if (!is_broken) return;
  connection.kill_reason = error.message();
  if (config_.kill_worker && connection.pid != 0) config_.kill_worker(connection.pid);
}

// A connection that asks for time slices has no task to end.
void TaskServer::end_worker(Connection& connection) noexcept {
  bool was_connected = false;
  {
    MutexLock lock(connection.mutex);
    was_connected = std::exchange(connection.state.connected, false);
  }
  {
    MutexLock lock(mutex_);
    connection.started.reset();
    connection.idle.connection = 0;
  }
  guarded("a worker's connection", [&] {
    if (was_connected) context_.metrics.add_worker_up(connection.device, -1);
    if (was_connected) {
      MutexLock lock(mutex_);
      context_.metrics.set_worker_memory(connection.device, memory_of(connection.device));
    }
  });
}

Result<json> TaskServer::receive_first(Connection& connection) {
  VOXELD_TRY(connection.socket.set_receive_timeout(kHelloSecondsMax));
  VOXELD_ASSIGN(const std::string frame, connection.socket.receive());
  VOXELD_ASSIGN(json message, parse_worker_message(frame));
  const std::string type = type_of(message);
  if (type != "turns") VOXELD_TRY(connection.files.create());
  if (type != "prepare") return message;
  VOXELD_TRY(connection.socket.send(dump(to_json_message(connection.files.folders()))));
  VOXELD_ASSIGN(const std::string next, connection.socket.receive());
  return parse_worker_message(next);
}

Status TaskServer::greet(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const WorkerHello hello, parse_worker_hello(message));
  if (hello.protocol != kTaskProtocolVersion) {
    return protocol_error("worker speaks another version of the task protocol",
                          std::to_string(kTaskProtocolVersion), std::to_string(hello.protocol));
  }
  connection.device = hello.device;
  connection.pid = hello.pid;
  if (!hello.renderer.empty()) note_connected(connection, hello);
  VOXELD_TRY(connection.socket.set_receive_timeout(0));
  return connection.socket.send(
      dump({{"ok", true}, {"scratch_dir", connection.files.folders().scratch_dir}}));
}

// Records a worker that has opened its device.
void TaskServer::note_connected(Connection& connection, const WorkerHello& hello) {
  const int slot = config_.slot_of ? config_.slot_of(hello.pid) : 0;
  {
    MutexLock lock(connection.mutex);
    WorkerState& state = connection.state;
    state.device = hello.device;
    state.slot = slot;
    state.renderer = hello.renderer;
    state.driver = hello.driver;
    state.pid = hello.pid;
    state.device_json = hello.device_json;
    state.sandbox = hello.sandbox;
    state.connected = true;
  }
  {
    MutexLock lock(mutex_);
    connection.idle.connection = connection.number;
    connection.idle.slot = slot;
  }
  context_.turns.set_device_bytes(hello.device, device_memory(hello.device_json));
  context_.metrics.add_worker_up(hello.device, 1);
  log::info("worker connected", {{"device", hello.device},
                                 {"slot", slot},
                                 {"pid", hello.pid},
                                 {"renderer", hello.renderer},
                                 {"driver", hello.driver},
                                 {"sandbox", hello.sandbox}});
  if (config_.on_connected) config_.on_connected(hello.device);
}

Status TaskServer::answer(Connection& connection, const std::string& frame) {
  VOXELD_ASSIGN(const json message, parse_worker_message(frame));
  const std::string type = type_of(message);
  if (type == "claim") return give_task(connection);
  if (type == "progress") return take_progress(connection, message);
  if (type == "frame") return take_frame(connection, message);
  if (type == "part") return take_part(connection, message);
  if (type == "complete") return take_completion(connection, message);
  if (type == "fail") return take_failure(connection, message);
  if (type == "park") return take_park(connection, message);
  return protocol_error("unknown task message",
                        "claim, progress, frame, part, complete, fail or park", type);
}

LiveJob TaskServer::live(const std::string& task) const {
  return {context_.board.live_version(task), context_.turns.device_us(task)};
}

Status TaskServer::take_progress(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskProgress progress, parse_task_progress(message));
  const bool fenced = progress.task != connection.task() || progress.fence != connection.fence;
  if (const DeviceMemory& memory = progress.device_memory; memory.bytes_total > 0) {
    context_.metrics.set_device_memory(connection.device, memory.bytes_total, memory.bytes_free);
    MutexLock lock(connection.mutex);
    connection.state.device_memory = memory;
  }
  const double cancel_age = fenced ? -1.0 : stop_age_seconds(connection);
  if (!fenced) {
    context_.board.progress(progress.task, progress.stage, progress.tiles_done,
                            progress.tiles_total, progress.frames_done, progress.frames_total);
  }
  if (connection.kill_reason.empty() && !fenced) {
    connection.kill_reason = overdue(connection, progress, cancel_age);
    if (!connection.kill_reason.empty() && config_.kill_worker) {
      log::warn(
          "worker is ended",
          {{"job", progress.task}, {"pid", connection.pid}, {"reason", connection.kill_reason}});
      config_.kill_worker(connection.pid);
    }
  }
  const bool park = !fenced && cancel_age < 0 && is_told_to_park(connection, progress);
  return connection.socket.send(
      dump({{"cancel", cancel_age >= 0}, {"fenced", fenced}, {"park", park}}));
}

Status TaskServer::take_frame(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskFrame frame, parse_task_frame(message));
  TaskFrameReply reply;
  reply.fenced = frame.task != connection.task() || frame.fence != connection.fence;
  if (!reply.fenced) {
    auto blob = adopt_frame(connection, frame);
    if (blob && *blob) {
      auto given = connection.files.hand_over(context_.blobs.path_of((*blob)->id));
      reply.cancel = stop_age_seconds(connection) >= 0;
      reply.grid = (*blob)->id;
      if (given) {
        reply.path = *std::move(given);
      } else {
        blob = std::move(given).error();
      }
    }
    reply.fenced = !blob || !*blob;
    if (!blob) {  // the disk is full, for one: the job cannot end well
      VOXELD_ASSIGN(const auto ended,
                    context_.jobs.fail(frame.task, frame.fence, blob.error(), live(frame.task)));
      if (ended) end_task(connection, *ended);
    }
  }
  return connection.socket.send(dump(to_json_message(reply)));
}

Status TaskServer::take_part(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskPart part, parse_task_part(message));
  if (part.task != connection.task() || part.fence != connection.fence) {
    return connection.socket.send(dump({{"cancel", false}, {"fenced", true}}));
  }
  const auto taken = connection.files.take(part.path);
  Status kept = context_.blobs.disk().for_data();
  if (kept) {
    kept = taken ? context_.parts.add(part.task, part.position, *taken) : Status(taken.error());
  }
  connection.since_progress.lap();
  const bool cancel = stop_age_seconds(connection) >= 0;
  json reply = {{"cancel", cancel}, {"fenced", false}};
  if (!kept) reply["error"] = kept.error().message();
  return connection.socket.send(dump(reply));
}

Status TaskServer::take_completion(Connection& connection, const json& message) {
  VOXELD_ASSIGN(TaskCompletion completion, parse_task_completion(message));
  if (completion.task != connection.task() || completion.fence != connection.fence) {
    return connection.socket.send(dump({{"fenced", true}}));
  }
  VOXELD_ASSIGN(const auto ended, end_completed(connection, std::move(completion)));
  if (!ended) return connection.socket.send(dump({{"fenced", true}}));
  end_task(connection, *ended);
  return connection.socket.send(dump({{"ok", true}}));
}

Status TaskServer::take_failure(Connection& connection, const json& message) {
  VOXELD_ASSIGN(TaskFailure failure, parse_task_failure(message));
  if (failure.task.empty()) {  // it could not open its device; the process ends next
    {
      MutexLock lock(connection.mutex);
      if (connection.state.connected) return protocol_error("fail.task", "a job", "none");
    }
    WorkerState state;
    state.device = connection.device;
    state.pid = connection.pid;
    state.last_error = failure.error.message();
    log::error("worker cannot open its device",
               {{"device", state.device}, {"error", state.last_error}});
    MutexLock lock(mutex_);
    std::erase_if(failed_devices_,
                  [&](const WorkerState& known) { return known.device == state.device; });
    failed_devices_.push_back(std::move(state));
    return connection.socket.send(dump({{"ok", true}}));
  }
  if (failure.task != connection.task() || failure.fence != connection.fence) {
    return connection.socket.send(dump({{"fenced", true}}));
  }
  const bool is_stopped = failure.error.code == ErrorCode::kCancelled;
  if (is_stopped && context_.board.cancel_age_seconds(failure.task) < 0 &&
      stop_age_seconds(connection) >= 0) {
    failure.error = deadline_error();
  }
  VOXELD_ASSIGN(const auto ended,
                context_.jobs.fail(failure.task, failure.fence, failure.error, live(failure.task)));
  if (!ended) return connection.socket.send(dump({{"fenced", true}}));
  end_task(connection, *ended);
  return connection.socket.send(dump({{"ok", true}}));
}

void TaskServer::end_task(Connection& connection, const JobRecord& record) {
  context_.turns.end_task(record.status.id, connection.fence);
  connection.set_task("", 0);
  {
    MutexLock lock(mutex_);
    connection.started.reset();
    connection.idle.tenant = record.tenant;
    connection.idle.has = {connection.input};
    if (record.status.result) connection.idle.has.push_back(record.status.result->grid);
    connection.idle.ended_at = ++tasks_ended_;
  }
  connection.files.clear();
  // First the metrics and all that goes with the job's end, then those who wait for it.
  context_.job_changed(record);
  context_.board.changed(record.status.id, record.status.version, false);
  if (Status status = connection.socket.set_receive_timeout(0); !status) {
    log::warn("task socket", {{"error", status.error().message()}});
  }
}

// How the worker was lost, for the job's error.
std::string TaskServer::lost_reason(Connection& connection, const Error& why, bool counts) {
  std::string reason = connection.kill_reason;
  {
    MutexLock lock(connection.mutex);
    if (reason.empty()) reason = connection.ended_for;
  }
  if (counts && reason.empty() && why.code == ErrorCode::kDeadlineExceeded) {
    reason = "no sign of life";
    if (config_.kill_worker)
      config_.kill_worker(connection.pid);  // it may not go on with this task
  } else if (counts && reason.empty() && config_.exit_reason) {
    reason = config_.exit_reason(connection.pid);
  }
  if (!reason.empty()) return reason;
  const bool closed = why.code == ErrorCode::kGone || why.detail.empty();
  return closed ? "connection lost" : why.message();
}

// The database may be full for hours, and a job must not hang in `running` for that: this goes on
// until it succeeds or the daemon stops, after which recover() does it.
void TaskServer::put_back(Connection& connection, const Error& why) noexcept {
  constexpr std::chrono::milliseconds kBetweenTries{500};
  constexpr int kTriesWhileStopping = 2;
  std::string reason;
  for (int tries = 0; !stopping_ || tries < kTriesWhileStopping; ++tries) {
    bool is_done = false;
    guarded("putting a job back", [&] {
      (void)take_assigned(connection);
      const std::string task = connection.task();
      // That the disk is full is not the job's fault.
      const bool counts = !stopping_ && why.code != ErrorCode::kStorageFull;
      if (!task.empty() && reason.empty()) reason = lost_reason(connection, why, counts);
      if (!task.empty()) {
        auto lost = end_lost(connection, task, reason, counts);
        if (!lost) {
          log::error("cannot put a job back", {{"job", task}, {"error", lost.error().message()}});
          return;
        }
        is_done = true;
        if (lost->has_value()) end_task(connection, **lost);
        notify_work();
      }
      is_done = true;
    });
    if (is_done) return;
    std::this_thread::sleep_for(kBetweenTries);
  }
}

// Failed, where the watch has ended the worker for what the job took; else the job is put back.
Result<std::optional<JobRecord>> TaskServer::end_lost(Connection& connection,
                                                      const std::string& task,
                                                      const std::string& reason, bool counts) {
  std::optional<Error> verdict;
  {
    MutexLock lock(connection.mutex);
    verdict = connection.verdict;
  }
  if (verdict) return context_.jobs.fail(task, connection.fence, *verdict, live(task));
  return context_.jobs.lose_worker(task, connection.fence, reason, counts, live(task));
}

}  // namespace voxeld
