#include "server/jobs/job_service.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "server/base/file_lock.h"
#include "server/base/log.h"
#include "server/jobs/asset_store.h"
#include "server/jobs/database.h"
#include "server/jobs/frame_store.h"
#include "server/jobs/job_board.h"
#include "server/jobs/job_metrics.h"
#include "server/jobs/job_store.h"
#include "server/jobs/quota.h"
#include "server/jobs/supervisor.h"
#include "server/jobs/task_server.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// Waits are cut into pieces of this length, to notice drain() and clients that left.
constexpr std::chrono::milliseconds kWaitSlice{200};
// How long the end of a worker's connection waits for the end of its process, to name the signal.
constexpr std::chrono::milliseconds kExitReasonWait{1000};
constexpr double kWorkerGraceSeconds = 5.0;

Result<UniqueFd> prepare_data_dir(const fs::path& dir) {
  std::error_code failed;
  const bool made = fs::create_directories(dir, failed);
  if (!failed && made) fs::permissions(dir, fs::perms::owner_all, failed);
  if (!failed) fs::create_directories(dir / "run", failed);
  if (failed) {
    return Error{ErrorCode::kInternal,
                 "cannot create the data directory " + dir.string() + ": " + failed.message(), "",
                 ""};
  }
  return lock_file(dir / "lock");
}

// Everything below runs on HTTP threads and on the task server's connection threads.
class Service final : public JobService {
 public:
  Service(const JobServiceConfig& config, UniqueFd lock, BlobStore blobs,
          std::unique_ptr<Database> database, std::shared_ptr<prometheus::Registry> registry)
      : config_(config),
        lock_(std::move(lock)),
        blobs_(std::move(blobs)),
        database_(std::move(database)),
        jobs_(*database_, [this](std::string_view id) { return blobs_.stat(id).ok(); }),
        assets_(*database_, blobs_),
        frames_(*database_, blobs_),
        metrics_(std::move(registry)) {}
  ~Service() override;

  Status start();

  Result<BlobWriter> begin_upload(int64_t bytes_max) override { return blobs_.begin(bytes_max); }
  Result<int64_t> upload_room(const Caller& caller, int64_t asked) override;
  TenantLimits limits(const Caller& caller) override {
    return config_.limits_of ? config_.limits_of(caller.tenant()) : TenantLimits{};
  }
  Result<TenantUsage> usage(const Caller& caller) override { return jobs_.usage(caller.tenant()); }
  Result<Asset> put_asset(const Caller& caller, const BlobInfo& blob, std::string filename,
                          std::string content_type) override {
    return assets_.put(caller, blob, filename, content_type, limits(caller).bytes);
  }
  Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, std::string filename,
                           const std::vector<BundleFile>& files) override {
    return assets_.put_bundle(caller, blob, filename, files, limits(caller).bytes);
  }
  Result<Asset> get_asset(const Caller& caller, std::string_view id) override {
    return assets_.get(caller, id);
  }
  Result<std::vector<Asset>> list_assets(const Caller& caller, int limit) override {
    return assets_.list(caller, limit);
  }
  Status delete_asset(const Caller& caller, std::string_view id) override;

  Result<JobStatus> submit(const Caller& caller, const JobRequest& request,
                           const SubmitOptions& options) override;
  Result<JobStatus> get(const Caller& caller, std::string_view id) override;
  Result<std::vector<JobStatus>> list(const Caller& caller, int limit,
                                      std::optional<JobState> state) override;
  Result<JobStatus> wait_change(const Caller& caller, std::string_view id, int64_t after_version,
                                Clock::time_point deadline) override;
  Result<JobStatus> wait_end(const Caller& caller, std::string_view id, Clock::time_point deadline,
                             const std::function<bool()>& abandoned) override;
  Result<std::vector<JobEvent>> wait_events(const Caller& caller, std::string_view id,
                                            int64_t after_id, Clock::time_point deadline) override;
  Result<JobStatus> cancel(const Caller& caller, std::string_view id) override;
  Result<StoredBlob> get_result(const Caller& caller, std::string_view job) override;

  Result<StoredBlob> get_grid(const Caller& caller, std::string_view id) override;
  Result<JobFrames> frames(const Caller& caller, std::string_view job) override;
  Result<SequenceManifest> get_sequence(const Caller& caller, std::string_view id) override {
    return frames_.read(caller, id);
  }
  std::vector<WorkerState> workers() override;
  int64_t queued_jobs() override;
  Status ready() override;
  void drain() override { draining_ = true; }

 private:
  void job_changed(const JobRecord& record);
  void update_gauges();
  void start_supervisor();
  Result<std::vector<JobEvent>> events_after(const Caller& caller, std::string_view id,
                                             int64_t after_id);
  Result<StoredBlob> stored(std::string_view id);

  const JobServiceConfig config_;
  const UniqueFd lock_;
  BlobStore blobs_;
  std::unique_ptr<Database> database_;
  JobStore jobs_;
  AssetStore assets_;
  FrameStore frames_;
  JobBoard board_;
  JobMetrics metrics_;
  std::atomic<bool> draining_{false};
  // Read by connection threads, which run before the supervisor is there.
  std::atomic<Supervisor*> supervising_{nullptr};
  std::unique_ptr<TaskServer> tasks_;
  std::unique_ptr<Supervisor> supervisor_;
};

Status Service::start() {
  VOXELD_ASSIGN(const int64_t recovered, jobs_.recover());
  if (recovered > 0) log::info("jobs of an earlier process recovered", {{"jobs", recovered}});
  VOXELD_TRY(assets_.remove_unneeded());
  VOXELD_TRY(jobs_.measure_holdings([this](std::string_view id) {
    const auto blob = blobs_.stat(id);
    return blob ? blob->bytes : int64_t{0};
  }));
  update_gauges();

  TaskServerConfig server;
  server.socket = config_.data_dir / "run" / "tasks.sock";
  server.scratch_root = config_.data_dir / "run" / "scratch";
  server.limits = config_.limits;
  server.limits_of = config_.limits_of;
  server.exit_reason = [this](int64_t pid) -> std::string {
    Supervisor* supervisor = supervising_;
    if (supervisor == nullptr) return "";
    const auto reason = supervisor->exit_reason(pid, kExitReasonWait);
    return reason ? reason->text() : "";
  };
  server.kill_worker = [this](int64_t pid) {
    if (Supervisor* supervisor = supervising_) supervisor->kill_worker(pid);
  };
  VOXELD_ASSIGN(tasks_,
                TaskServer::start(std::move(server),
                                  {jobs_, assets_, frames_, blobs_, board_, metrics_,
                                   [this](const JobRecord& record) { job_changed(record); }}));
  if (config_.start_workers) start_supervisor();
  return {};
}

void Service::start_supervisor() {
  SupervisorConfig config;
  config.executable = config_.worker_executable;
  config.gateway = "unix:" + (config_.data_dir / "run" / "tasks.sock").string();
  config.devices = config_.devices;
  config.arguments = config_.worker_arguments;
  config.on_exit = [this](const std::string& device, const ExitReason&) {
    metrics_.worker_restarted(device);
  };
  supervisor_ = std::make_unique<Supervisor>(std::move(config));
  supervising_ = supervisor_.get();
}

Service::~Service() {
  draining_ = true;
  // First the connections: their tasks go back to the queue, and workers end when theirs closes.
  if (tasks_ != nullptr) tasks_->stop();
  supervising_ = nullptr;
  if (supervisor_ != nullptr) supervisor_->stop(kWorkerGraceSeconds);
}

void Service::job_changed(const JobRecord& record) {
  const JobStatus& status = record.status;
  if (status.ended()) {
    board_.changed(status.id, status.version, false);
    metrics_.ended(status);
    log::info("job ended", {{"job", status.id},
                            {"tenant", record.tenant},
                            {"kind", job_kind_name(status.kind)},
                            {"state", job_state_name(status.state)},
                            {"cached", status.cached ? 1 : 0},
                            {"ms", status.ended_ms - status.created_ms},
                            {"error", status.error ? status.error->message() : ""}});
    if (auto removed = assets_.remove_unneeded(); !removed) {
      log::warn("cannot remove deleted assets", {{"error", removed.error().message()}});
    }
  } else if (status.state == JobState::kRunning) {
    metrics_.claimed(status);
    log::debug("job starts", {{"job", status.id}, {"worker", record.worker}});
  } else {
    metrics_.requeued(status);
    log::warn("job is queued again",
              {{"job", status.id}, {"attempt", status.attempt}, {"workers", record.lost_workers}});
  }
  update_gauges();
}

void Service::update_gauges() {
  const auto queued = jobs_.count(JobState::kQueued);
  const auto running = jobs_.count(JobState::kRunning);
  if (queued && running) metrics_.set_jobs(*queued, *running);
}

Result<int64_t> Service::upload_room(const Caller& caller, int64_t asked) {
  const int64_t bytes_max = limits(caller).bytes;
  if (bytes_max <= 0) return std::numeric_limits<int64_t>::max();
  VOXELD_ASSIGN(const TenantUsage used, usage(caller));
  const int64_t room = std::max<int64_t>(0, bytes_max - used.bytes);
  if (asked > room) return bytes_error(asked, used.bytes, bytes_max);
  return room;
}

Status Service::delete_asset(const Caller& caller, std::string_view id) {
  VOXELD_TRY(assets_.mark_deleted(caller, id));
  VOXELD_TRY(assets_.remove_unneeded());
  return {};
}

Result<JobStatus> Service::submit(const Caller& caller, const JobRequest& request,
                                  const SubmitOptions& options) {
  if (draining_) {
    return Error{ErrorCode::kShuttingDown, "the daemon is shutting down; try again", "", ""};
  }
  VOXELD_ASSIGN(JobStore::Submitted submitted,
                jobs_.submit(caller, request, options,
                             {config_.queued_jobs_max, limits(caller).queued_jobs}));
  JobRecord& record = submitted.record;
  board_.overlay(record.status);
  if (submitted.existed) return record.status;
  metrics_.submitted(record.status);
  if (record.status.ended()) {
    job_changed(record);
  } else {
    update_gauges();
    tasks_->notify_work();
  }
  return record.status;
}

Result<JobStatus> Service::get(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id));
  board_.overlay(record.status);
  return record.status;
}

Result<std::vector<JobStatus>> Service::list(const Caller& caller, int limit,
                                             std::optional<JobState> state) {
  VOXELD_ASSIGN(const std::vector<JobRecord> records, jobs_.list(caller, limit, state));
  std::vector<JobStatus> statuses;
  statuses.reserve(records.size());
  for (const JobRecord& record : records) {
    statuses.push_back(record.status);
    board_.overlay(statuses.back());
  }
  return statuses;
}

Result<JobStatus> Service::wait_change(const Caller& caller, std::string_view id,
                                       int64_t after_version, Clock::time_point deadline) {
  JobBoard::Watch watch(board_, std::string(id));
  while (true) {
    VOXELD_ASSIGN(JobStatus status, get(caller, id));
    const auto now = Clock::now();
    if (status.version > after_version || status.ended() || now >= deadline || draining_) {
      return status;
    }
    watch.wait(after_version, std::min(deadline, now + kWaitSlice));
  }
}

Result<JobStatus> Service::wait_end(const Caller& caller, std::string_view id,
                                    Clock::time_point deadline,
                                    const std::function<bool()>& abandoned) {
  JobBoard::Watch watch(board_, std::string(id));
  while (true) {
    VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id));
    board_.overlay(record.status);
    const auto now = Clock::now();
    if (record.status.ended() || now >= deadline) return record.status;
    if (abandoned && abandoned()) {
      if (record.transient) return cancel(caller, id);
      return record.status;
    }
    watch.wait(record.status.version, std::min(deadline, now + kWaitSlice));
  }
}

Result<std::vector<JobEvent>> Service::events_after(const Caller& caller, std::string_view id,
                                                    int64_t after_id) {
  // The status first: a state change that comes after it is then in the list, and the older
  // progress is left out.
  VOXELD_ASSIGN(const JobStatus status, get(caller, id));
  VOXELD_ASSIGN(std::vector<JobEvent> events, jobs_.events(caller, id, after_id));
  const int64_t last = events.empty() ? after_id : events.back().id;
  if (status.state == JobState::kRunning && status.version > last) {
    events.push_back(
        {status.version, "progress",
         job_status_json(status).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)});
  }
  return events;
}

Result<std::vector<JobEvent>> Service::wait_events(const Caller& caller, std::string_view id,
                                                   int64_t after_id, Clock::time_point deadline) {
  JobBoard::Watch watch(board_, std::string(id));
  while (true) {
    VOXELD_ASSIGN(std::vector<JobEvent> events, events_after(caller, id, after_id));
    const auto now = Clock::now();
    if (!events.empty() || now >= deadline || draining_) return events;
    watch.wait(after_id, std::min(deadline, now + kWaitSlice));
  }
}

Result<JobStatus> Service::cancel(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord before, jobs_.get(caller, id));
  if (before.status.ended()) return before.status;
  VOXELD_ASSIGN(JobRecord record, jobs_.cancel(caller, id));
  if (record.status.ended()) {
    job_changed(record);
  } else {
    board_.request_cancel(record.status.id);
    board_.overlay(record.status);
  }
  return record.status;
}

Result<StoredBlob> Service::stored(std::string_view id) {
  VOXELD_ASSIGN(BlobInfo blob, blobs_.stat(id));
  return StoredBlob{std::move(blob.id), blob.bytes, blobs_.path_of(id)};
}

Result<StoredBlob> Service::get_result(const Caller& caller, std::string_view job) {
  VOXELD_ASSIGN(const JobRecord record, jobs_.get(caller, job));
  if (record.status.result) return stored(record.status.result->blob);
  return Error{ErrorCode::kConflict, "the job " + record.status.id + " has no result", "done",
               std::string(job_state_name(record.status.state))};
}

Result<StoredBlob> Service::get_grid(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(const bool known, jobs_.is_grid(caller, id));
  if (!known) {
    return Error{ErrorCode::kNotFound, "no such grid", "the id of a grid",
                 std::string(id.substr(0, 80))};
  }
  return stored(id);
}

Result<JobFrames> Service::frames(const Caller& caller, std::string_view job) {
  VOXELD_ASSIGN(const JobStatus status, get(caller, job));
  JobFrames frames{
      status.id, status.result ? status.result->sequence : "", status.frames_total, {}};
  VOXELD_ASSIGN(frames.frames, frames_.of_job(job));
  if (!frames.frames.empty() || frames.sequence.empty()) return frames;
  // Answered from another job's result.
  VOXELD_ASSIGN(SequenceManifest manifest, frames_.read(caller, frames.sequence));
  for (SequenceFrame& frame : manifest.frames) {
    frames.frames.push_back({static_cast<int64_t>(frames.frames.size()), std::move(frame)});
  }
  return frames;
}

std::vector<WorkerState> Service::workers() {
  std::vector<WorkerState> states = tasks_->workers();
  for (const std::string& device : config_.devices) {
    const bool known = std::any_of(states.begin(), states.end(), [&](const WorkerState& state) {
      return state.device == device;
    });
    if (known) continue;
    WorkerState state;
    state.device = device;
    states.push_back(std::move(state));
  }
  if (Supervisor* supervisor = supervising_) {
    for (WorkerState& state : states) state.restarts = supervisor->restarts(state.device);
  }
  return states;
}

int64_t Service::queued_jobs() {
  const auto count = jobs_.count(JobState::kQueued);
  return count ? *count : 0;
}

Status Service::ready() {
  if (draining_) return Error{ErrorCode::kShuttingDown, "the daemon is shutting down", "", ""};
  VOXELD_TRY(jobs_.count(JobState::kQueued));
  VOXELD_TRY(blobs_.begin(0));
  std::string reason;
  for (const WorkerState& state : workers()) {
    if (state.connected) return {};
    if (!state.last_error.empty()) reason = state.device + ": " + state.last_error;
  }
  return Error{ErrorCode::kDeviceUnavailable,
               reason.empty() ? "no worker is connected" : "no worker is connected: " + reason, "",
               ""};
}

}  // namespace

Result<std::unique_ptr<JobService>> start_job_service(
    const JobServiceConfig& config, std::shared_ptr<prometheus::Registry> metrics) {
  VOXELD_ASSIGN(UniqueFd lock, prepare_data_dir(config.data_dir));
  VOXELD_ASSIGN(BlobStore blobs, BlobStore::open(config.data_dir));
  VOXELD_ASSIGN(auto database, Database::open(config.data_dir / "jobs.sqlite"));
  auto service = std::make_unique<Service>(config, std::move(lock), std::move(blobs),
                                           std::move(database), std::move(metrics));
  VOXELD_TRY(service->start());
  return std::unique_ptr<JobService>(std::move(service));
}

}  // namespace voxeld
