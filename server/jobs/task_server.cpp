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

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kHelloSecondsMax = 10.0;
// A worker that waits for work is looked at so often, to notice that it has died.
constexpr std::chrono::milliseconds kIdlePoll{200};
// Waiting workers look into the queue so often even when nobody told them of work.
constexpr int kIdlePollsPerClaim = 10;

std::string dump(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

Error protocol_error(std::string detail, std::string expected, std::string got) {
  return {ErrorCode::kBadRequest, std::move(detail), std::move(expected), std::move(got)};
}

// The path of an output that a worker names, which must be in its own folder.
Status check_output(const fs::path& scratch, const std::string& output) {
  const fs::path path(output);
  if (path.parent_path() == scratch && path.filename() != "..") return {};
  return Error{ErrorCode::kInternal, "worker names an output outside its scratch directory",
               scratch.string(), output};
}

}  // namespace

// Owned by its thread, but for `state`, which workers() reads.
struct TaskServer::Connection {
  Connection(UniqueFd fd, fs::path scratch_dir)
      : socket(std::move(fd), kTaskFrameBytesMax), scratch(std::move(scratch_dir)) {}

  void set_task(std::string id, int64_t new_fence) {
    fence = new_fence;
    MutexLock lock(mutex);
    state.task = std::move(id);
  }
  std::string task() {
    MutexLock lock(mutex);
    return state.task;
  }

  FrameSocket socket;
  const fs::path scratch;
  int64_t fence = 0;
  std::string device;
  int64_t pid = 0;
  TaskProgress progress;     // the last report that said something new …
  Stopwatch since_progress;  // … and its age
  std::string kill_reason;   // why the worker was killed from here, once it was
  std::atomic<bool> ended{false};
  std::thread thread;
  Mutex mutex;
  WorkerState state GUARDED_BY(mutex);
};

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
}

TaskServer::~TaskServer() {
  stop();
}

void TaskServer::stop() {
  if (stopping_.exchange(true)) return;
  ::shutdown(listener_.get(), SHUT_RDWR);  // accept() returns
  notify_work();
  if (accept_thread_.joinable()) accept_thread_.join();
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
  const fs::path scratch = config_.scratch_root / ("w" + std::to_string(++connections_made_));
  connections_.push_back(std::make_unique<Connection>(std::move(fd), scratch));
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
  std::error_code ignored;  // the next start removes what stays
  fs::remove_all(connection.scratch, ignored);
}

Status TaskServer::greet(Connection& connection) {
  VOXELD_TRY(connection.socket.set_receive_timeout(kHelloSecondsMax));
  VOXELD_ASSIGN(const std::string frame, connection.socket.receive());
  VOXELD_ASSIGN(const json message, parse_json_bounded(frame));
  VOXELD_ASSIGN(const WorkerHello hello, parse_worker_hello(message));
  if (hello.protocol != kTaskProtocolVersion) {
    return protocol_error("worker speaks another version of the task protocol",
                          std::to_string(kTaskProtocolVersion), std::to_string(hello.protocol));
  }
  std::error_code failed;
  fs::create_directories(connection.scratch, failed);
  if (failed) {
    return Error{ErrorCode::kInternal, "create scratch directory: " + failed.message(), "", ""};
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
    state.connected = opened;
  }
  if (opened) {
    context_.metrics.set_worker_up(hello.device, true);
    log::info("worker connected", {{"device", hello.device},
                                   {"pid", hello.pid},
                                   {"renderer", hello.renderer},
                                   {"driver", hello.driver}});
  }
  VOXELD_TRY(connection.socket.set_receive_timeout(0));
  return connection.socket.send(dump({{"ok", true}, {"scratch_dir", connection.scratch.string()}}));
}

Status TaskServer::answer(Connection& connection, const std::string& frame) {
  VOXELD_ASSIGN(const json message, parse_task_message(frame));
  const std::string type = message.is_object() ? message.value("type", "") : "";
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
      const auto task = make_task(record);
      if (task) return send_task(connection, record, *task);
      VOXELD_TRY(refuse_task(record, task.error()));
      continue;
    }
    for (int polls = 0; polls < kIdlePollsPerClaim && !stopping_; ++polls) {
      if (wait_for_work(seen) || connection.socket.peer_closed()) break;
    }
  }
  return Error{ErrorCode::kGone, "the gateway stops", "", ""};
}

Result<Task> TaskServer::make_task(const JobRecord& record) {
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
  task.input_path = context_.blobs.path_of(task.input_hash).string();
  task.filename = status.filename;
  task.options_json = status.options_json;
  task.tenant = record.tenant;
  if (config_.limits_of) task.cells_max = config_.limits_of(record.tenant).cells;
  if (task.input_is_sequence) {
    VOXELD_ASSIGN(const SequenceManifest manifest,
                  context_.frames.read(Caller::daemon(), status.sequence));
    for (const SequenceFrame& frame : manifest.frames) {
      task.frame_paths.push_back(context_.blobs.path_of(frame.grid).string());
    }
  }
  if (!status.asset.empty()) {
    VOXELD_ASSIGN(const auto files,
                  context_.assets.bundle_files(record.asset_tenant, status.asset));
    for (const BundleFile& file : files) {
      task.bundle_paths.push_back(context_.blobs.path_of(file.asset).string());
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
  VOXELD_TRY(check_output(connection.scratch, frame.path));
  VOXELD_ASSIGN(BlobInfo blob, context_.blobs.adopt(frame.path));
  // The first frames of a job may come before its first progress.
  const int64_t total = std::max(frame.frames_total, connection.progress.frames_total);
  auto listed = context_.frames.add(frame, blob, total, limits_of(frame.task).bytes);
  if (!listed) {
    const std::string id = blob.id;
    blob = {};  // lets go of it
    VOXELD_TRY(context_.assets.remove_unnamed({id}));
    return std::move(listed).error();
  }
  if (!*listed) return std::optional<BlobInfo>();
  context_.board.frames_listed(frame.task, **listed);
  context_.metrics.frame_done();
  connection.since_progress.lap();
  return std::optional(std::move(blob));
}

Status TaskServer::take_frame(Connection& connection, const json& message) {
  VOXELD_ASSIGN(const TaskFrame frame, parse_task_frame(message));
  TaskFrameReply reply;
  reply.fenced = frame.task != connection.task() || frame.fence != connection.fence;
  if (!reply.fenced) {
    const auto blob = adopt_frame(connection, frame);
    reply.fenced = !blob || !*blob;
    if (blob && *blob) {
      reply.cancel = context_.board.cancel_age_seconds(frame.task) >= 0;
      reply.grid = (*blob)->id;
      reply.path = context_.blobs.path_of((*blob)->id).string();
    } else if (!blob) {  // the disk is full, for one: the job cannot end well
      VOXELD_ASSIGN(const auto ended, context_.jobs.fail(frame.task, frame.fence, blob.error(),
                                                         context_.board.live_version(frame.task)));
      if (ended) end_task(connection, *ended);
    }
  }
  return connection.socket.send(dump(to_json_message(reply)));
}

// Of the tenant whose job it is.
TenantLimits TaskServer::limits_of(std::string_view task) {
  if (!config_.limits_of) return {};
  const auto record = context_.jobs.get(Caller::daemon(), task);
  return record ? config_.limits_of(record->tenant) : TenantLimits{};
}

// `adopted` keeps them in the store until the database names them.
Status TaskServer::adopt_outputs(const Connection& connection, const TaskCompletion& completion,
                                 std::map<std::string, BlobInfo>& adopted, FinishedTask& finished) {
  JobResult& result = finished.result;
  result.meta_json = completion.meta_json;
  result.warnings = completion.warnings;
  for (const TaskOutput& output : completion.outputs) {
    VOXELD_TRY(check_output(connection.scratch, output.path));
    if (!adopted.contains(output.path)) {  // a native result is its own grid: one file, two roles
      VOXELD_ASSIGN(adopted[output.path], context_.blobs.adopt(output.path));
    }
    const BlobInfo& blob = adopted[output.path];
    if (output.role == "grid") {
      result.grid = blob.id;
      finished.grid_bytes = blob.bytes;
    }
    if (output.role == "sequence") {
      result.sequence = blob.id;
      finished.sequence_bytes = blob.bytes;
    }
    if (output.role != "result") continue;
    result.blob = blob.id;
    result.bytes = blob.bytes;
    result.media_type = output.media_type;
    result.filename = output.filename;
  }
  return {};
}

// Stores what a worker made and ends the job: done, or failed when that cannot be stored.
Result<std::optional<JobRecord>> TaskServer::end_completed(const Connection& connection,
                                                           TaskCompletion completion) {
  const int64_t live_version = context_.board.live_version(completion.task);
  const auto fail = [&](const Error& error) {
    return context_.jobs.fail(completion.task, completion.fence, error, live_version);
  };
  const Stopwatch watch;
  std::map<std::string, BlobInfo> adopted;
  FinishedTask finished;
  finished.task = completion.task;
  finished.fence = completion.fence;
  finished.bytes_max = limits_of(completion.task).bytes;
  if (const Status stored = adopt_outputs(connection, completion, adopted, finished); !stored) {
    return fail(stored.error());
  }
  if (const std::string& sequence = finished.result.sequence; !sequence.empty()) {
    const auto frames = context_.frames.check(completion.task, sequence);
    if (!frames) return fail(frames.error());
    finished.frames = *frames;
  }
  add_stage(completion.timings, "store", watch.ms());
  finished.timings = std::move(completion.timings);
  auto ended = context_.jobs.complete(finished, live_version);
  if (!ended) return fail(ended.error());
  if (*ended && (*ended)->status.error) {  // more than its tenant may keep
    std::vector<std::string> ids;
    for (const auto& [path, blob] : adopted) ids.push_back(blob.id);
    adopted.clear();  // lets go of them
    if (const Status removed = context_.assets.remove_unnamed(ids); !removed) {
      log::warn("cannot remove what a tenant may not keep", {{"error", removed.error().message()}});
    }
  }
  return ended;
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
    auto lost = context_.jobs.lose_worker(task, connection.fence, reason, counts,
                                          context_.board.live_version(task));
    if (lost) {
      if (lost->has_value()) end_task(connection, **lost);
      notify_work();
      return;
    }
    log::error("cannot put a job back", {{"job", task}, {"error", lost.error().message()}});
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
}

}  // namespace voxeld
