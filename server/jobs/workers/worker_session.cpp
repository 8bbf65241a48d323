#include "server/jobs/workers/worker_session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "proto/messages/task_bounds.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/records/job_rows.h"
#include "server/jobs/workers/slice_server.h"
#include "server/jobs/workers/task_builder.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr size_t kDeviceFailureBytesMax = 2000;  // of a worker's text; the rest is cut
constexpr double kHelloSecondsMax = 30.0;        // a busy machine opens a device in seconds
// Part of the reported device memory that tasks may use; drivers and other processes need some.
constexpr double kDeviceMemoryShare = 0.75;

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

bool is_same_report(const TaskProgress& a, const TaskProgress& b) {
  return a.stage == b.stage && a.tiles_done == b.tiles_done && a.tiles_total == b.tiles_total &&
         a.frames_done == b.frames_done && a.frames_total == b.frames_total;
}

}  // namespace

WorkerSession::WorkerSession(int64_t number, UniqueFd connection, fs::path folder,
                             const WorkerSessionContext& context)
    : number_(number),
      context_(context),
      socket_(std::move(connection), kTaskFrameBytesMax),
      rate_(context.config.limits),
      files_(std::move(folder)) {
  socket_.distrust(limits::kWorkerMessageBytesMax, context.config.limits.message_seconds_max);
}

WorkerState WorkerSession::state() const {
  MutexLock lock(mutex_);
  return state_;
}

std::string WorkerSession::task() const {
  MutexLock lock(mutex_);
  return state_.task;
}

std::optional<WatchedWorker> WorkerSession::watched() const {
  MutexLock lock(mutex_);
  if (!state_.connected) return std::nullopt;
  return WatchedWorker{.pid = state_.pid,
                       .task = state_.task,
                       .task_seconds = task_age_.ms() / 1000.0,
                       .silent_seconds = silence_ ? silence_->ms() / 1000.0 : 0.0,
                       .was_displaced = was_displaced_};
}

std::optional<WatchedScratch> WorkerSession::watched_scratch() const {
  MutexLock lock(mutex_);
  if (!state_.connected || state_.task.empty()) return std::nullopt;
  return WatchedScratch{state_.pid, state_.task, files_.written()};
}

void WorkerSession::set_memory(int64_t bytes) {
  MutexLock lock(mutex_);
  state_.memory_bytes = bytes;
}

// The connection ends, too, where the process cannot be killed from here.
void WorkerSession::end(int64_t pid, const std::string& task_id, const WorkerLoss& loss,
                        const std::optional<Error>& verdict) {
  MutexLock lock(mutex_);
  if (state_.pid != pid || state_.task != task_id) return;
  ended_ = loss;
  verdict_ = verdict;
  kill(pid);
  socket_.shutdown();
}

void WorkerSession::kill(int64_t pid) const {
  if (context_.config.kill_worker && pid != 0) context_.config.kill_worker(pid);
}

void WorkerSession::run() noexcept {
  Status status;
  try {
    status = converse();
  } catch (const std::exception& failure) {
    status = exception_error(failure);
  }
  context_.dispatcher.retire(number_);
  guarded("a worker's session", [&] {
    if (!status && status.error().code != ErrorCode::kGone && !context_.stopping) {
      blame(status.error());
    }
  });
  put_back(status ? Error{} : std::move(status).error());
  socket_.shutdown();  // a worker that broke the protocol must notice
  leave();
  files_.remove();
  has_ended_ = true;
}

// --- the conversation

Status WorkerSession::converse() {
  VOXELD_ASSIGN(const json first, receive_first());
  if (type_of(first) == "slices") {
    VOXELD_ASSIGN(const SlicesHello worker, parse_slices_hello(first));
    device_ = worker.device;
    pid_ = worker.pid;
    return serve_slices(
        socket_, worker,
        {context_.parts.slices, context_.parts.board, context_.stopping, context_.config.limits});
  }
  VOXELD_TRY(greet(first));
  while (!context_.stopping) {
    VOXELD_ASSIGN(const std::string frame, receive());
    VOXELD_TRY(rate_.take());
    VOXELD_TRY(handle(frame));
  }
  return {};
}

Result<json> WorkerSession::receive_first() {
  VOXELD_TRY(socket_.set_receive_timeout(kHelloSecondsMax));
  VOXELD_ASSIGN(const std::string frame, socket_.receive());
  VOXELD_ASSIGN(json message, parse_worker_message(frame));
  const std::string type = type_of(message);
  if (type != "slices") VOXELD_TRY(files_.create());
  if (type != "prepare") return message;
  WorkerFolders folders = files_.folders();
  VOXELD_ASSIGN(folders.disk_reserve_bytes, context_.parts.disk.worker_reserve_bytes());
  VOXELD_TRY(send(to_json_message(folders)));
  VOXELD_ASSIGN(const std::string next, socket_.receive());
  return parse_worker_message(next);
}

Status WorkerSession::greet(const json& message) {
  VOXELD_ASSIGN(const WorkerHello hello, parse_worker_hello(message));
  if (hello.protocol != kTaskProtocolVersion) {
    return protocol_error("worker speaks another version of the task protocol",
                          std::to_string(kTaskProtocolVersion), std::to_string(hello.protocol));
  }
  device_ = hello.device;
  pid_ = hello.pid;
  if (!hello.renderer.empty()) enter(hello);
  VOXELD_TRY(socket_.set_receive_timeout(0));
  return send({{"ok", true}, {"scratch_dir", files_.folders().scratch_dir}});
}

void WorkerSession::enter(const WorkerHello& hello) {
  const TaskServerConfig& config = context_.config;
  const int slot = config.slot_of ? config.slot_of(hello.pid) : 0;
  {
    MutexLock lock(mutex_);
    state_.device = hello.device;
    state_.slot = slot;
    state_.renderer = hello.renderer;
    state_.driver = hello.driver;
    state_.pid = hello.pid;
    state_.device_json = hello.device_json;
    state_.sandbox = hello.sandbox;
    state_.device_failure = hello.device_failure.substr(0, kDeviceFailureBytesMax);
    state_.connected = true;
  }
  context_.dispatcher.add(
      {number_, hello.pid, hello.device, slot, [this] { return socket_.peer_closed(); }});
  context_.parts.slices.set_device_bytes(hello.device, device_memory(hello.device_json));
  context_.parts.metrics.add_worker_up(hello.device, 1);
  log::info("worker connected", {{"device", hello.device},
                                 {"slot", slot},
                                 {"pid", hello.pid},
                                 {"renderer", hello.renderer},
                                 {"driver", hello.driver},
                                 {"sandbox", hello.sandbox},
                                 {"device_failure", hello.device_failure}});
  context_.device_changed(hello.device);
  if (config.on_connected) config.on_connected(hello.device);
}

// A connection for time slices, or of a worker without a device, never entered.
void WorkerSession::leave() noexcept {
  bool was_connected = false;
  {
    MutexLock lock(mutex_);
    was_connected = std::exchange(state_.connected, false);
  }
  guarded("a worker's session", [&] {
    context_.dispatcher.remove(number_);
    if (was_connected) context_.parts.metrics.add_worker_up(device_, -1);
  });
}

Result<std::string> WorkerSession::receive() {
  {
    MutexLock lock(mutex_);
    silence_.emplace();
  }
  auto frame = socket_.receive();
  MutexLock lock(mutex_);
  silence_.reset();
  return frame;
}

Status WorkerSession::send(const json& message) {
  return socket_.send(message.dump(-1, ' ', false, json::error_handler_t::replace));
}

// A worker that breaks the protocol may belong to the file that it reads: its process ends too, and
// is replaced.
void WorkerSession::blame(const Error& error) {
  const bool is_broken =
      error.code == ErrorCode::kBadRequest || error.code == ErrorCode::kPayloadTooLarge;
  log::warn(is_broken ? "worker breaks the task protocol" : "worker connection ends",
            {{"device", device_},
             {"pid", pid_},
             {"job", task()},
             {"tenant", context_.dispatcher.tenant_of(number_)},
             {"error", error.message()}});
  if (!is_broken) return;
  kill_reason_ = error.message();
  kill(pid_);
}

Status WorkerSession::handle(const std::string& frame) {
  VOXELD_ASSIGN(const json message, parse_worker_message(frame));
  const std::string type = type_of(message);
  if (type == "claim") return give_task();
  if (type == "progress") return take_progress(message);
  if (type == "frame") return take_frame(message);
  if (type == "part") return take_part(message);
  if (type == "complete") return take_completion(message);
  if (type == "fail") return take_failure(message);
  if (type == "preempt") return take_preemption(message);
  return protocol_error("unknown task message",
                        "claim, progress, frame, part, complete, fail or preempt", type);
}

// --- messages

Status WorkerSession::give_task() {
  if (!task().empty()) {
    return protocol_error("claim while a task runs", "complete or fail", "claim");
  }
  TaskBuilder builder(context_.config, context_.parts, files_);
  while (const auto record = context_.dispatcher.wait(number_)) {
    // From here on the end of the session puts the job back: it is either assigned or the task.
    set_task(record->status.id, record->fence);
    context_.dispatcher.accept(number_);
    const auto built = builder.build(*record);
    if (built) return send_task(*record, *built);
    files_.clear();
    VOXELD_TRY(refuse_task(*record, built.error()));
    set_task("", 0);
  }
  return Error{ErrorCode::kGone, "connection closed, or the gateway stops", "", ""};
}

Status WorkerSession::send_task(const JobRecord& record, const Task& sent) {
  const JobStatus& status = record.status;
  const TaskServerContext& parts = context_.parts;
  input_ = sent.input_hash;
  tenant_ = record.tenant;
  deadline_ms_ = record.deadline_ms;
  parts.slices.begin_task({status.id, record.fence, device_, record.tenant, status.priority,
                           deadline_ms_ == kNoDeadline ? 0 : deadline_ms_, record.seq, pid_});
  if (status.attempt == 1 && status.preempted == 0) {
    parts.metrics.waited(record.tenant,
                         static_cast<double>(status.started_ms - status.created_ms) / 1000.0);
  }
  parts.board.start(status.id, status.version);
  // A cancel that came between the claim and the line above is in the database alone. Without this
  // look the job could not be cancelled any more, so where it fails the job is put back.
  VOXELD_ASSIGN(const JobRecord now, parts.jobs.get(Caller::daemon(), status.id));
  if (now.cancel_requested) parts.board.request_cancel(status.id);
  parts.job_changed(record);
  wait_for_memory(record);
  progress_ = {};
  since_progress_.lap();
  kill_reason_.clear();
  VOXELD_TRY(socket_.set_receive_timeout(context_.config.limits.silence_seconds_max));
  if (context_.config.on_task) context_.config.on_task(pid_);
  has_worker_ = true;
  return send({{"task", to_json_message(sent)}});
}

// A job that was displaced starts once what it took then fits beside the others. One that is to
// stop meanwhile starts, too, and is told.
void WorkerSession::wait_for_memory(const JobRecord& record) {
  if (record.displaced_bytes == 0) return;
  (void)context_.parts.slices.reserve(record.status.id, fence_, record.displaced_bytes, [this] {
    return context_.stopping || stop_age_seconds() >= 0 || socket_.peer_closed();
  });
  MutexLock lock(mutex_);
  was_displaced_ = true;
  task_age_.lap();
}

// A job whose task cannot be told ends as failed, before any worker has it.
Status WorkerSession::refuse_task(const JobRecord& record, const Error& error) {
  const TaskServerContext& parts = context_.parts;
  VOXELD_ASSIGN(const auto ended,
                parts.jobs.fail(record.status.id, record.fence, error, record.status.version));
  if (!ended) return {};
  parts.board.changed(ended->status.id, ended->status.version, false);
  parts.job_changed(*ended);
  return {};
}

Status WorkerSession::take_progress(const json& message) {
  VOXELD_ASSIGN(const TaskProgress progress, parse_task_progress(message));
  if (const DeviceMemory& memory = progress.device_memory; memory.bytes_total > 0) {
    context_.parts.metrics.set_device_memory(device_, memory.bytes_total, memory.bytes_free);
    MutexLock lock(mutex_);
    state_.device_memory = memory;
  }
  if (!is_mine(progress.task, progress.fence)) {
    return send(to_json_message(TaskProgressReply{.fenced = true}));
  }
  const double stop_age = stop_age_seconds();
  context_.parts.board.progress(progress.task, progress.stage, progress.tiles_done,
                                progress.tiles_total, progress.frames_done, progress.frames_total);
  if (kill_reason_.empty()) {
    kill_reason_ = overdue(progress, stop_age);
    if (!kill_reason_.empty()) {
      log::warn("worker is ended",
                {{"job", progress.task}, {"pid", pid_}, {"reason", kill_reason_}});
      kill(pid_);
    }
  }
  const bool preempt = stop_age < 0 && context_.dispatcher.report(number_, progress);
  return send(to_json_message(TaskProgressReply{.cancel = stop_age >= 0, .preempt = preempt}));
}

// Lets the worker read the frame that it has just made.
Result<std::string> WorkerSession::hand_over(const std::string& grid) const {
  VOXELD_ASSIGN(const std::filesystem::path file, context_.parts.blobs.local_file(grid));
  return files_.hand_over(file);
}

Status WorkerSession::take_frame(const json& message) {
  VOXELD_ASSIGN(const TaskFrame frame, parse_task_frame(message));
  TaskFrameReply reply;
  reply.fenced = !is_mine(frame.task, frame.fence);
  if (reply.fenced) return send(to_json_message(reply));
  auto blob = context_.outputs.add_frame(files_, frame, progress_.frames_total);
  if (blob && *blob) {
    since_progress_.lap();
    auto given = hand_over((*blob)->id);
    reply.cancel = stop_age_seconds() >= 0;
    reply.grid = (*blob)->id;
    if (given) {
      reply.path = *std::move(given);
    } else {
      blob = std::move(given).error();
    }
  }
  reply.fenced = !blob || !*blob;
  if (!blob) {  // the disk is full, for one: the job cannot end well
    files_.clear();
    VOXELD_ASSIGN(const auto ended, context_.parts.jobs.fail(frame.task, frame.fence, blob.error(),
                                                             context_.parts.live(frame.task)));
    if (ended) end_task(*ended);
  }
  return send(to_json_message(reply));
}

Status WorkerSession::take_part(const json& message) {
  VOXELD_ASSIGN(const TaskPart part, parse_task_part(message));
  TaskPartReply reply;
  reply.fenced = !is_mine(part.task, part.fence);
  if (reply.fenced) return send(to_json_message(reply));
  const Status stored = context_.outputs.add_part(files_, part);
  since_progress_.lap();
  reply.cancel = stop_age_seconds() >= 0;
  if (!stored) reply.error = stored.error().message();
  return send(to_json_message(reply));
}

Status WorkerSession::take_completion(const json& message) {
  VOXELD_ASSIGN(TaskCompletion completion, parse_task_completion(message));
  if (!is_mine(completion.task, completion.fence)) return send({{"fenced", true}});
  VOXELD_ASSIGN(const auto ended, context_.outputs.complete(files_, std::move(completion)));
  if (!ended) return send({{"fenced", true}});
  end_task(*ended);
  return send({{"ok", true}});
}

Status WorkerSession::take_failure(const json& message) {
  VOXELD_ASSIGN(TaskFailure failure, parse_task_failure(message));
  if (failure.task.empty()) return take_device_failure(failure.error);
  if (!is_mine(failure.task, failure.fence)) return send({{"fenced", true}});
  const bool is_stopped = failure.error.code == ErrorCode::kCancelled;
  // The end of its time slices stopped it, and nobody has cancelled it: it is put back.
  if (is_stopped && context_.stopping && stop_age_seconds() < 0) {
    return Error{ErrorCode::kGone, "the gateway stops", "", ""};
  }
  if (is_stopped && context_.parts.board.cancel_age_seconds(failure.task) < 0 &&
      stop_age_seconds() >= 0) {
    failure.error = deadline_error();
  }
  files_.clear();  // first, since the disk may be full of what it wrote
  VOXELD_ASSIGN(const auto ended,
                context_.parts.jobs.fail(failure.task, failure.fence, failure.error,
                                         context_.parts.live(failure.task)));
  if (!ended) return send({{"fenced", true}});
  end_task(*ended);
  return send({{"ok", true}});
}

Status WorkerSession::take_device_failure(const Error& error) {
  if (state().connected) {
    log::warn(error.detail.empty() ? "the device works again" : "the CPU replaces the device",
              {{"device", device_}, {"error", error.detail}});
    {
      MutexLock lock(mutex_);
      state_.device_failure = error.detail.substr(0, kDeviceFailureBytesMax);
    }
    context_.device_changed(device_);
    return send({{"ok", true}});
  }
  WorkerState failed;
  failed.device = device_;
  failed.pid = pid_;
  failed.last_error = error.message();
  log::error("worker cannot open its device",
             {{"device", failed.device}, {"error", failed.last_error}});
  context_.device_failed(std::move(failed));
  return send({{"ok", true}});
}

Status WorkerSession::take_preemption(const json& message) {
  VOXELD_ASSIGN(const TaskPreemption preempted, parse_task_preempt(message));
  if (!is_mine(preempted.task, preempted.fence)) return send({{"fenced", true}});
  if (!context_.dispatcher.was_asked(number_)) {
    return protocol_error("a task was preempted", "only where it was asked for", preempted.task);
  }
  VOXELD_ASSIGN(const auto queued,
                context_.parts.jobs.preempt(preempted, context_.parts.live(preempted.task)));
  if (!queued) return send({{"fenced", true}});
  end_task(*queued);
  context_.dispatcher.notify_work();
  return send({{"ok", true}});
}

// --- the task

bool WorkerSession::is_mine(const std::string& task_id, int64_t fence) const {
  return task_id == task() && fence == fence_;
}

void WorkerSession::set_task(std::string id, int64_t fence) {
  fence_ = fence;
  has_worker_ = false;
  MutexLock lock(mutex_);
  state_.task = std::move(id);
  task_age_.lap();
  was_displaced_ = false;
  verdict_.reset();
  ended_.reset();
}

// The job's end is durable: a step that fails must not keep the next ones from being done, last of
// all that requests that wait for the job are woken.
void WorkerSession::end_task(const JobRecord& record) {
  const auto step = [](const auto& work) { guarded_twice("the end of a task", work); };
  step([&] { context_.parts.slices.end_task(record.status.id, fence_); });
  set_task("", 0);
  step([&] {
    std::vector<std::string> cached = {input_};
    if (record.status.result) cached.push_back(record.status.result->grid);
    context_.dispatcher.end_task(number_, record.tenant, std::move(cached));
  });
  step([&] { files_.clear(); });
  // First the metrics and all that goes with the job's end, then those who wait for it.
  context_.parts.job_changed(record);
  step([&] { context_.parts.board.changed(record.status.id, record.status.version, false); });
  if (Status status = socket_.set_receive_timeout(0); !status) {
    log::warn("task socket", {{"error", status.error().message()}});
  }
}

std::string WorkerSession::overdue(const TaskProgress& progress, double stop_age) {
  if (!is_same_report(progress, progress_)) {
    progress_ = progress;
    since_progress_.lap();
  }
  const TaskLimits& limits = context_.config.limits;
  const auto seconds = [](double value) { return std::to_string(std::lround(value)) + " s"; };
  if (stop_age > limits.cancel_seconds_max) return "ignored a cancel for " + seconds(stop_age);
  // A task that waits for a slice or memory, or prepares, reports no progress; it is not stalled.
  if (context_.parts.slices.is_waiting(progress.task)) since_progress_.lap();
  if (since_progress_.ms() <= limits.stall_seconds_max * 1000.0) return "";
  return "no progress in stage " + progress.stage + " for " +
         seconds(since_progress_.ms() / 1000.0);
}

double WorkerSession::stop_age_seconds() const {
  const double cancelled = context_.parts.board.cancel_age_seconds(task());
  const int64_t late_ms = context_.parts.jobs.deadline_now_ms() - deadline_ms_;
  if (deadline_ms_ == kNoDeadline || late_ms < 0) return cancelled;
  return std::max(cancelled, static_cast<double>(late_ms) / 1000.0);
}

}  // namespace voxeld
