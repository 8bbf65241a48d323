#include "server/jobs/task_server.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "server/base/log.h"
#include "server/base/stopwatch.h"
#include "server/jobs/task_connection.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kHelloSecondsMax = 30.0;  // a busy machine opens a device in seconds
// A worker that waits for work is looked at so often, to notice that it has died.
constexpr std::chrono::milliseconds kIdlePoll{200};
// Waiting workers look into the queue so often even when nobody told them of work.
constexpr int kIdlePollsPerClaim = 10;

std::string dump(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

// Empty where it is no text: value() would throw.
std::string type_of(const json& message) {
  const auto type = message.find("type");
  return type != message.end() && type->is_string() ? type->get<std::string>() : "";
}

Error protocol_error(std::string detail, std::string expected, std::string got) {
  return {ErrorCode::kBadRequest, std::move(detail), std::move(expected), std::move(got)};
}

}  // namespace

Result<std::unique_ptr<TaskServer>> TaskServer::start(TaskServerConfig config,
                                                      TaskServerContext context) {
  std::error_code failed;
  fs::remove_all(config.scratch_root, failed);  // what workers of an earlier daemon left
  fs::create_directories(config.scratch_root, failed);
  if (failed) {
    return Error{ErrorCode::kInternal, "create directory scratch: " + failed.message(), "", ""};
  }
  VOXELD_ASSIGN(UniqueFd listener, listen_unix(config.socket));
  return std::unique_ptr<TaskServer>(
      new TaskServer(std::move(config), std::move(context), std::move(listener)));
}

TaskServer::TaskServer(TaskServerConfig config, TaskServerContext context, UniqueFd listener)
    : config_(std::move(config)), context_(std::move(context)), listener_(std::move(listener)) {
  // In the body: the thread uses members that are declared after it.
  accept_thread_ = std::thread([this] { accept_loop(); });
  watch_ = std::make_unique<WorkerWatch>(
      WatchLimits{config_.limits.worker_memory_bytes_max, config_.limits.job_seconds_max},
      watch_calls());
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
      add_connection(std::move(fd));
    } else if (errno != EINTR && errno != ECONNABORTED && !stopping_) {
      // Out of descriptors, for one: those who hold them may let go.
      log::error("task socket cannot accept", {{"errno", errno}});
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    join_ended(false);
  }
}

void TaskServer::add_connection(UniqueFd fd) {
  MutexLock lock(mutex_);
  const fs::path folder = config_.scratch_root / ("w" + std::to_string(++connections_made_));
  connections_.push_back(std::make_unique<Connection>(std::move(fd), folder));
  Connection& connection = *connections_.back();
  connection.thread = std::thread([this, &connection] {
    serve(connection);
    connection.ended = true;
  });
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

void TaskServer::serve(Connection& connection) {
  Status status = greet(connection);
  while (status && !stopping_) {
    auto frame = connection.socket.receive();
    status = frame ? answer(connection, *frame) : Status(std::move(frame).error());
  }
  if (!status && status.error().code != ErrorCode::kGone && !stopping_) {
    log::warn("worker connection ends",
              {{"device", connection.device}, {"error", status.error().message()}});
  }
  put_back(connection, status ? Error{} : status.error());
  connection.socket.shutdown();  // a worker that broke the protocol must notice
  if (!connection.device.empty()) context_.metrics.set_worker_up(connection.device, false);
  {
    MutexLock lock(connection.mutex);
    connection.state.connected = false;
  }
  if (connection.device.empty()) return;
  MutexLock lock(mutex_);
  context_.metrics.set_worker_memory(connection.device, memory_of(connection.device));
}

Status TaskServer::greet(Connection& connection) {
  VOXELD_TRY(connection.socket.set_receive_timeout(kHelloSecondsMax));
  VOXELD_TRY(connection.files.create());
  VOXELD_ASSIGN(std::string frame, connection.socket.receive());
  VOXELD_ASSIGN(json message, parse_json_bounded(frame));
  if (type_of(message) == "prepare") {
    VOXELD_TRY(connection.socket.send(dump(to_json_message(connection.files.folders()))));
    VOXELD_ASSIGN(frame, connection.socket.receive());
    VOXELD_ASSIGN(message, parse_json_bounded(frame));
  }
  VOXELD_ASSIGN(const WorkerHello hello, parse_worker_hello(message));
  if (hello.protocol != kTaskProtocolVersion) {
    return protocol_error("worker speaks another version of the task protocol",
                          std::to_string(kTaskProtocolVersion), std::to_string(hello.protocol));
  }
  connection.device = hello.device;
  connection.pid = hello.pid;
  const bool opened = !hello.renderer.empty();
  {
    MutexLock lock(connection.mutex);
    WorkerState& state = connection.state;
    state.device = hello.device;
    state.renderer = hello.renderer;
    state.driver = hello.driver;
    state.pid = hello.pid;
    state.device_json = hello.device_json;
    state.sandbox = hello.sandbox;
    state.connected = opened;
  }
  if (opened) {
    context_.metrics.set_worker_up(hello.device, true);
    log::info("worker connected", {{"device", hello.device},
                                   {"pid", hello.pid},
                                   {"renderer", hello.renderer},
                                   {"driver", hello.driver},
                                   {"sandbox", hello.sandbox}});
  }
  VOXELD_TRY(connection.socket.set_receive_timeout(0));
  return connection.socket.send(
      dump({{"ok", true}, {"scratch_dir", connection.files.folders().scratch_dir}}));
}

Status TaskServer::answer(Connection& connection, const std::string& frame) {
  VOXELD_ASSIGN(const json message, parse_task_message(frame));
  const std::string type = type_of(message);
  if (type == "claim") return give_task(connection);
  if (type == "progress") return take_progress(connection, message);
  if (type == "frame") return take_frame(connection, message);
  if (type == "complete") return take_completion(connection, message);
  if (type == "fail") return take_failure(connection, message);
  return protocol_error("unknown task message", "claim, progress, frame, complete or fail", type);
}

bool TaskServer::wait_for_work(uint64_t seen) {
  MutexLock lock(mutex_);
  if (work_epoch_ == seen && !stopping_) work_.wait_for(lock, kIdlePoll);
  return work_epoch_ != seen;
}

Status TaskServer::give_task(Connection& connection) {
  if (!connection.task().empty()) {
    return protocol_error("claim while a task runs", "complete or fail", "claim");
  }
  while (!stopping_) {
    uint64_t seen = 0;
    {
      MutexLock lock(mutex_);
      seen = work_epoch_;
    }
    // A worker that died while it waited must not cost the next job an attempt.
    if (connection.socket.peer_closed()) {
      return Error{ErrorCode::kGone, "connection closed", "", ""};
    }
    auto claimed = context_.jobs.claim(connection.device);
    if (!claimed) {
      log::error("cannot claim a job", {{"error", claimed.error().message()}});
      std::this_thread::sleep_for(std::chrono::seconds(1));
      continue;
    }
    if (claimed->has_value() && (*claimed)->status.ended()) {  // an equal job's result was there
      context_.job_changed(**claimed);
      continue;
    }
    if (claimed->has_value()) {
      const JobRecord& record = **claimed;
      const auto task = make_task(connection.files, record);
      if (task) return send_task(connection, record, *task);
      connection.files.clear();
      VOXELD_TRY(refuse_task(record, task.error()));
      continue;
    }
    for (int polls = 0; polls < kIdlePollsPerClaim && !stopping_; ++polls) {
      if (wait_for_work(seen) || connection.socket.peer_closed()) break;
    }
  }
  return Error{ErrorCode::kGone, "the gateway stops", "", ""};
}

Result<Task> TaskServer::make_task(const WorkerFiles& files, const JobRecord& record) {
  const auto hand_over = [&](const std::string& blob) {
    return files.hand_over(context_.blobs.path_of(blob));
  };
  const JobStatus& status = record.status;
  Task task;
  task.id = status.id;
  task.fence = record.fence;
  task.attempt = status.attempt;
  task.kind = status.kind;
  task.input_is_grid = !status.grid.empty();
  task.input_is_sequence = !status.sequence.empty();
  task.input_hash = task.input_is_grid       ? status.grid
                    : task.input_is_sequence ? status.sequence
                                             : status.asset;
  VOXELD_ASSIGN(task.input_path, hand_over(task.input_hash));
  task.filename = status.filename;
  task.options_json = status.options_json;
  task.tenant = record.tenant;
  task.request_id = record.request_id;
  task.trace_id = record.trace_id;
  if (task.input_is_sequence) {
    VOXELD_ASSIGN(const SequenceManifest manifest,
                  context_.frames.read(Caller::daemon(), status.sequence));
    for (const SequenceFrame& frame : manifest.frames) {
      VOXELD_ASSIGN(task.frame_paths.emplace_back(), hand_over(frame.grid));
    }
  }
  if (!status.asset.empty()) {
    VOXELD_ASSIGN(const auto bundled,
                  context_.assets.bundle_files(record.asset_tenant, status.asset));
    for (const BundleFile& file : bundled) {
      VOXELD_ASSIGN(task.bundle_paths.emplace_back(), hand_over(file.asset));
    }
  }
  return task;
}

// A job whose task cannot be told ends as failed, before any worker has it.
Status TaskServer::refuse_task(const JobRecord& record, const Error& error) {
  VOXELD_ASSIGN(const auto ended,
                context_.jobs.fail(record.status.id, record.fence, error, record.status.version));
  if (!ended) return {};
  context_.board.changed(ended->status.id, ended->status.version, false);
  context_.job_changed(*ended);
  return {};
}

Status TaskServer::send_task(Connection& connection, const JobRecord& record, const Task& task) {
  const JobStatus& status = record.status;
  connection.set_task(status.id, record.fence);
  context_.board.start(status.id, status.version);
  // A cancel that came between the claim and the line above is in the database alone.
  if (auto now = context_.jobs.get(Caller::daemon(), status.id); now && now->cancel_requested) {
    context_.board.request_cancel(status.id);
  }
  context_.job_changed(record);
  connection.progress = {};
  connection.since_progress.lap();
  connection.kill_reason.clear();
  VOXELD_TRY(connection.socket.set_receive_timeout(config_.limits.silence_seconds_max));
  return connection.socket.send(dump({{"task", to_json_message(task)}}));
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
  if (connection.since_progress.ms() > config_.limits.stall_seconds_max * 1000.0) {
    return "no progress in stage " + progress.stage + " for " +
           seconds(connection.since_progress.ms() / 1000.0);
  }
  return "";
}

Status TaskServer::take_progress(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskProgress progress, parse_task_progress(message));
  const bool fenced = progress.task != connection.task() || progress.fence != connection.fence;
  if (const DeviceMemory& memory = progress.device_memory; memory.bytes_total > 0) {
    context_.metrics.set_device_memory(connection.device, memory.bytes_total, memory.bytes_free);
    MutexLock lock(connection.mutex);
    connection.state.device_memory = memory;
  }
  const double cancel_age = fenced ? -1.0 : context_.board.cancel_age_seconds(progress.task);
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
  return connection.socket.send(dump({{"cancel", cancel_age >= 0}, {"fenced", fenced}}));
}

// Stores and lists a frame; nullopt when another worker owns the job by now.
Result<std::optional<BlobInfo>> TaskServer::adopt_frame(Connection& connection,
                                                        const TaskFrame& frame) {
  VOXELD_ASSIGN(const fs::path taken, connection.files.take(frame.path));
  VOXELD_ASSIGN(BlobInfo blob, context_.blobs.adopt(taken));
  // The first frames of a job may come before its first progress.
  const int64_t total = std::max(frame.frames_total, connection.progress.frames_total);
  VOXELD_ASSIGN(const auto listed, context_.frames.add(frame, blob.id, total));
  if (!listed) return std::optional<BlobInfo>();
  context_.board.frames_listed(frame.task, *listed);
  context_.metrics.frame_done();
  connection.since_progress.lap();
  return std::optional(std::move(blob));
}

Status TaskServer::take_frame(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskFrame frame, parse_task_frame(message));
  TaskFrameReply reply;
  reply.fenced = frame.task != connection.task() || frame.fence != connection.fence;
  if (!reply.fenced) {
    auto blob = adopt_frame(connection, frame);
    if (blob && *blob) {
      auto given = connection.files.hand_over(context_.blobs.path_of((*blob)->id));
      reply.cancel = context_.board.cancel_age_seconds(frame.task) >= 0;
      reply.grid = (*blob)->id;
      if (given) {
        reply.path = *std::move(given);
      } else {
        blob = std::move(given).error();
      }
    }
    reply.fenced = !blob || !*blob;
    if (!blob) {  // the disk is full, for one: the job cannot end well
      VOXELD_ASSIGN(const auto ended, context_.jobs.fail(frame.task, frame.fence, blob.error(),
                                                         context_.board.live_version(frame.task)));
      if (ended) end_task(connection, *ended);
    }
  }
  return connection.socket.send(dump(to_json_message(reply)));
}

// `adopted` keeps them in the store until the database names them.
Result<JobResult> TaskServer::adopt_outputs(const Connection& connection,
                                            const TaskCompletion& completion,
                                            std::map<std::string, BlobInfo>& adopted) {
  JobResult result;
  result.meta_json = completion.meta_json;
  result.warnings = completion.warnings;
  for (const TaskOutput& output : completion.outputs) {
    if (!adopted.contains(output.path)) {  // a native result is its own grid: one file, two roles
      VOXELD_ASSIGN(const fs::path taken, connection.files.take(output.path));
      VOXELD_ASSIGN(adopted[output.path], context_.blobs.adopt(taken));
    }
    const BlobInfo& blob = adopted[output.path];
    if (output.role == "grid") result.grid = blob.id;
    if (output.role == "sequence") result.sequence = blob.id;
    if (output.role != "result") continue;
    result.blob = blob.id;
    result.bytes = blob.bytes;
    result.media_type = output.media_type;
    result.filename = output.filename;
  }
  return result;
}

// Stores what a worker made and ends the job: done, or failed when that cannot be stored.
Result<std::optional<JobRecord>> TaskServer::end_completed(const Connection& connection,
                                                           TaskCompletion completion) {
  const int64_t live_version = context_.board.live_version(completion.task);
  const Stopwatch watch;
  std::map<std::string, BlobInfo> adopted;
  auto result = adopt_outputs(connection, completion, adopted);
  if (!result) {
    return context_.jobs.fail(completion.task, completion.fence, result.error(), live_version);
  }
  Result<int64_t> frames = int64_t{0};
  if (!result->sequence.empty()) frames = context_.frames.check(completion.task, result->sequence);
  if (!frames) {
    return context_.jobs.fail(completion.task, completion.fence, frames.error(), live_version);
  }
  add_stage(completion.timings, "store", watch.ms());
  auto ended = context_.jobs.complete({completion.task, completion.fence, *std::move(result),
                                       std::move(completion.timings), *frames},
                                      live_version);
  if (ended) return ended;
  return context_.jobs.fail(completion.task, completion.fence, ended.error(), live_version);
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
  VOXELD_ASSIGN(const TaskFailure failure, parse_task_failure(message));
  if (failure.task.empty()) {  // it could not open its device; the process ends next
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
  VOXELD_ASSIGN(const auto ended, context_.jobs.fail(failure.task, failure.fence, failure.error,
                                                     context_.board.live_version(failure.task)));
  if (!ended) return connection.socket.send(dump({{"fenced", true}}));
  end_task(connection, *ended);
  return connection.socket.send(dump({{"ok", true}}));
}

void TaskServer::end_task(Connection& connection, const JobRecord& record) {
  connection.set_task("", 0);
  connection.files.clear();
  context_.board.changed(record.status.id, record.status.version, false);
  context_.job_changed(record);
  if (Status status = connection.socket.set_receive_timeout(0); !status) {
    log::warn("task socket", {{"error", status.error().message()}});
  }
}

void TaskServer::put_back(Connection& connection, const Error& why) {
  const std::string task = connection.task();
  if (task.empty()) return;
  const bool counts = !stopping_;
  std::string reason = connection.kill_reason;
  if (counts && why.code == ErrorCode::kDeadlineExceeded) {
    reason = "no sign of life";
    if (config_.kill_worker)
      config_.kill_worker(connection.pid);  // it may not go on with this task
  } else if (counts && reason.empty() && config_.exit_reason) {
    reason = config_.exit_reason(connection.pid);
  }
  if (reason.empty()) {
    const bool closed = why.code == ErrorCode::kGone || why.detail.empty();
    reason = closed ? "connection lost" : why.message();
  }
  // The database may be full or slow for a moment; a job must not hang in `running` for that.
  for (int tries = 0; tries < 10; ++tries) {
    auto lost = end_lost(connection, task, reason, counts);
    if (lost) {
      if (lost->has_value()) end_task(connection, **lost);
      notify_work();
      return;
    }
    log::error("cannot put a job back", {{"job", task}, {"error", lost.error().message()}});
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
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
  const int64_t live_version = context_.board.live_version(task);
  if (verdict) return context_.jobs.fail(task, connection.fence, *verdict, live_version);
  return context_.jobs.lose_worker(task, connection.fence, reason, counts, live_version);
}

}  // namespace voxeld
