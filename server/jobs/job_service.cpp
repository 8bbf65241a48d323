#include "server/jobs/job_service.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <semaphore>
#include <system_error>
#include <utility>

#include "proto/job_text.h"
#include "server/base/file.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/asset_store.h"
#include "server/jobs/blob_needs.h"
#include "server/jobs/data_dir.h"
#include "server/jobs/database.h"
#include "server/jobs/deadline_watch.h"
#include "server/jobs/device_turns.h"
#include "server/jobs/frame_store.h"
#include "server/jobs/job_board.h"
#include "server/jobs/job_log.h"
#include "server/jobs/job_metrics.h"
#include "server/jobs/job_store.h"
#include "server/jobs/queue_forecast.h"
#include "server/jobs/queue_view.h"
#include "server/jobs/quota.h"
#include "server/jobs/retention.h"
#include "server/jobs/store_sweep.h"
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
// Rows with all their texts that are read at a time, each of which may take megabytes.
constexpr int kWholeReadsMax = 4;

// Everything below runs on HTTP threads and on the task server's connection threads.
class Service final : public JobService {
 public:
  Service(const JobServiceConfig& config, UniqueFd lock, BlobStore blobs, PartStore parts,
          std::unique_ptr<Database> database, std::shared_ptr<prometheus::Registry> registry)
      : config_(config),
        lock_(std::move(lock)),
        blobs_(std::move(blobs)),
        database_(std::move(database)),
        jobs_(*database_, [this](std::string_view id) { return blobs_.is_usable(id); }),
        parts_(std::move(parts)),
        assets_(*database_, blobs_),
        frames_(*database_, blobs_),
        metrics_(std::move(registry)),
        costs_(config.data_dir / "costs"),
        forecast_(
            costs_, static_cast<int>(config.devices.size()),
            [this](const std::string& tenant) {
              return config_.weight_of ? static_cast<double>(config_.weight_of(tenant)) : 1.0;
            },
            [this](JobStatus& status) { board_.overlay(status); }),
        turns_(turns_config()),
        retention_(*database_, blobs_),
        sweep_(config_.storage, retention_, assets_, blobs_, metrics_) {}
  ~Service() override;

  Status start();

  Result<BlobWriter> begin_upload(int64_t bytes_max) override {
    VOXELD_TRY(sweep_.room());
    return blobs_.begin(bytes_max);
  }
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
  Status list_assets(const Caller& caller, const AssetCursor& after,
                     const std::function<bool(const Asset&)>& take) override {
    return assets_.list(caller, after, take);
  }
  Status delete_asset(const Caller& caller, std::string_view id) override;

  Result<JobStatus> submit(const Caller& caller, const JobRequest& request,
                           const SubmitOptions& options) override;
  Result<JobStatus> price(const Caller& caller, const JobRequest& request) override;
  Result<JobStatus> get(const Caller& caller, std::string_view id) override;
  Result<JobStatus> get_whole(const Caller& caller, std::string_view id) override;
  Status list(const Caller& caller, const JobQuery& query,
              const std::function<bool(const JobStatus&)>& take) override;
  Result<JobStatus> wait_change(const Caller& caller, std::string_view id, int64_t after_version,
                                Clock::time_point deadline) override;
  Result<JobStatus> wait_end(const Caller& caller, std::string_view id, Clock::time_point deadline,
                             const std::function<bool()>& abandoned) override;
  Result<std::vector<JobEvent>> wait_events(const Caller& caller, std::string_view id,
                                            int64_t after_id, Clock::time_point deadline) override;
  Result<JobStatus> cancel(const Caller& caller, std::string_view id) override;
  Result<StoredBlob> result_of(const JobStatus& status) override;

  Result<StoredBlob> get_grid(const Caller& caller, std::string_view id) override;
  Result<JobFrames> frames(const Caller& caller, std::string_view job,
                           const FrameRange& range) override;
  Result<SequenceManifest> get_sequence(const Caller& caller, std::string_view id) override {
    return frames_.read(caller, id);
  }
  Result<QueueView> queue(const Caller& caller, int limit) override {
    return queue_view(jobs_, workers(), caller, limit,
                      [this](JobStatus& status) { overlay(status); });
  }
  std::vector<WorkerState> workers() override;
  int64_t queued_jobs() override;
  Status ready() override;
  void drain() override { draining_ = true; }

 private:
  void job_changed(const JobRecord& record);
  void update_gauges();
  // Of the asset with its files, or the grid; 0 where it cannot be told.
  int64_t input_bytes(const std::string& tenant, const std::string& asset, const std::string& grid);
  void forecast_waiting();
  TurnsConfig turns_config();
  // Adds what the database does not know to a status.
  void overlay(JobStatus& status);
  TaskServerConfig server_config();
  void start_supervisor();
  Result<std::vector<JobEvent>> events_after(const Caller& caller, std::string_view id,
                                             int64_t after_id);
  Result<StoredBlob> stored(std::string_view id, std::string_view what);
  void verify_reusable(const Caller& caller, const JobRequest& request);

  const JobServiceConfig config_;
  const UniqueFd lock_;
  BlobStore blobs_;
  std::unique_ptr<Database> database_;
  JobStore jobs_;
  PartStore parts_;
  AssetStore assets_;
  FrameStore frames_;
  JobBoard board_;
  JobMetrics metrics_;
  JobCosts costs_;
  QueueForecast forecast_;
  DeviceTurns turns_;
  Retention retention_;
  StoreSweep sweep_;
  std::counting_semaphore<kWholeReadsMax> whole_reads_{kWholeReadsMax};
  std::atomic<bool> draining_{false};
  // Read by connection threads, which run before the supervisor is there.
  std::atomic<Supervisor*> supervising_{nullptr};
  std::unique_ptr<TaskServer> tasks_;
  std::unique_ptr<Supervisor> supervisor_;
  std::unique_ptr<DeadlineWatch> deadlines_;  // last: its thread uses the others
};

TurnsConfig Service::turns_config() {
  TurnsConfig config;
  config.is_fair = config_.is_fair;
  config.host_bytes_max = config_.memory_bytes_max;
  config.weight_of = config_.weight_of;
  config.charged = [this](const TurnTask& task, double seconds) {
    metrics_.had_turn(task.device, task.tenant, seconds);
  };
  return config;
}

void Service::overlay(JobStatus& status) {
  board_.overlay(status);
  forecast_.fill(status);
  if (status.state == JobState::kQueued) status.waiting_for = "a worker";
  if (status.state != JobState::kRunning) return;
  status.waiting_for = turns_.waiting_for(status.id);
  status.device_ms += static_cast<double>(turns_.device_us(status.id)) / 1000.0;
}

Status Service::start() {
  VOXELD_ASSIGN(const int64_t recovered, jobs_.recover());
  if (recovered > 0) log::info("jobs of an earlier process recovered", {{"jobs", recovered}});
  if (auto removed = assets_.remove_unneeded(); !removed) {  // the disk may be full just now
    log::warn("cannot remove deleted assets", {{"error", removed.error().message()}});
  }
  parts_.remove_unless([this](std::string_view id) {
    const auto job = jobs_.get(Caller::daemon(), id);
    return job && !job->status.ended();
  });
  VOXELD_TRY(jobs_.measure_holdings([this](std::string_view id) {
    const auto blob = blobs_.stat(id);
    return blob ? blob->bytes : int64_t{0};
  }));
  update_gauges();
  forecast_waiting();

  VOXELD_ASSIGN(
      tasks_, TaskServer::start(server_config(),
                                {jobs_, assets_, frames_, blobs_, parts_, board_, metrics_, turns_,
                                 [this](const JobRecord& record) { job_changed(record); }}));
  deadlines_ = std::make_unique<DeadlineWatch>(
      jobs_, [this](const JobRecord& record) { job_changed(record); });
  sweep_.start();
  if (config_.start_workers) start_supervisor();
  return {};
}

TaskServerConfig Service::server_config() {
  TaskServerConfig server;
  server.is_fair = config_.is_fair;
  server.socket = config_.data_dir / "run" / "tasks.sock";
  server.scratch_root = config_.data_dir / "run" / "scratch";
  server.limits = config_.limits;
  server.limits_of = config_.limits_of;
  server.expected_seconds = [this](const std::string& job) {
    return forecast_.expected_seconds(job);
  };
  server.exit_reason = [this](int64_t pid) -> std::string {
    Supervisor* supervisor = supervising_;
    if (supervisor == nullptr) return "";
    const auto reason = supervisor->exit_reason(pid, kExitReasonWait);
    if (!reason) return "";
    const bool lost = reason->signal == 0 && reason->status == Supervisor::kExitContextLost;
    return lost ? "the GL context was lost" : reason->text();
  };
  server.kill_worker = [this](int64_t pid) {
    if (Supervisor* supervisor = supervising_) supervisor->kill_worker(pid);
  };
  server.slot_of = [this](int64_t pid) {
    Supervisor* supervisor = supervising_;
    return supervisor == nullptr ? 0 : supervisor->slot_of(pid).value_or(0);
  };
  server.on_connected = [this](const std::string& device) {
    if (Supervisor* supervisor = supervising_) supervisor->start_others(device);
  };
  return server;
}

void Service::start_supervisor() {
  SupervisorConfig config;
  config.executable = config_.worker_executable;
  config.gateway = "unix:" + (config_.data_dir / "run" / "tasks.sock").string();
  config.devices = config_.devices;
  config.workers_per_device = config_.is_fair ? config_.workers_per_device : 1;
  config.arguments = config_.worker_arguments;
  config.on_exit = [this](const std::string& device, const ExitReason&) {
    metrics_.worker_restarted(device);
  };
  supervisor_ = std::make_unique<Supervisor>(std::move(config));
  supervising_ = supervisor_.get();
  // Workers that were connected before that line.
  for (const WorkerState& state : tasks_->workers()) {
    if (state.connected) supervisor_->start_others(state.device);
  }
}

Service::~Service() {
  draining_ = true;
  deadlines_.reset();
  sweep_.stop();
  // First the connections: their tasks go back to the queue, and workers end when theirs closes.
  if (tasks_ != nullptr) tasks_->stop();
  supervising_ = nullptr;
  if (supervisor_ != nullptr) supervisor_->stop(kWorkerGraceSeconds);
}

void Service::job_changed(const JobRecord& record) {
  const JobStatus& status = record.status;
  forecast_.changed(record, 0);
  log_job_change(record);
  if (status.ended()) {
    parts_.remove(status.id);
    metrics_.ended(status, record.tenant, record.worker);
    board_.changed(status.id, status.version, false);
    // Where they were to go meanwhile, they stayed for the job.
    for (const std::string& input : {status.grid, status.sequence}) {
      if (!input.empty()) blobs_.suspect(input);
    }
    if (auto removed = assets_.remove_unneeded(); !removed) {
      log::warn("cannot remove deleted assets", {{"error", removed.error().message()}});
    }
  } else if (status.state == JobState::kRunning) {
    metrics_.claimed(status);
  } else if (record.was_parked) {
    metrics_.parked(status, record.tenant);
  } else {
    metrics_.requeued(status);
  }
  update_gauges();
}

void Service::update_gauges() {
  const auto queued = jobs_.count(JobState::kQueued);
  const auto running = jobs_.count(JobState::kRunning);
  if (queued && running) metrics_.set_jobs(*queued, *running);
}

int64_t Service::input_bytes(const std::string& tenant, const std::string& asset,
                             const std::string& grid) {
  const auto bytes_of = [this](const std::string& id) {
    const auto blob = blobs_.stat(id);
    return blob ? blob->bytes : int64_t{0};
  };
  if (asset.empty()) return bytes_of(grid);
  int64_t bytes = bytes_of(asset);
  if (const auto files = assets_.bundle_files(tenant, asset)) {
    for (const BundleFile& file : *files) bytes += bytes_of(file.asset);
  }
  return bytes;
}

// At start: the jobs that an earlier process left.
void Service::forecast_waiting() {
  JobQuery query;
  query.state = JobState::kQueued;
  Status listed = jobs_.list(Caller::daemon(), query, [&](JobRecord&& record) -> Result<bool> {
    const JobStatus& status = record.status;
    forecast_.changed(record, input_bytes(record.asset_tenant, status.asset, status.grid));
    return true;
  });
  if (!listed) log::warn("cannot forecast waiting jobs", {{"error", listed.error().message()}});
}

Result<JobStatus> Service::price(const Caller& caller, const JobRequest& request) {
  JobRequest filled = request;
  VOXELD_ASSIGN(const bool cached, jobs_.has_result(caller, filled));
  JobStatus priced = forecast_.price(caller.tenant(), filled,
                                     input_bytes(caller.tenant(), filled.asset, filled.grid));
  if (!cached) return priced;
  priced.cached = true;
  priced.queue_position = 0;
  priced.estimate = JobEstimate{};
  priced.expected_start_ms = priced.expected_end_ms = unix_time_ms();
  return priced;
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
  // It is deleted; that its bytes go may wait for the next time.
  if (auto removed = assets_.remove_unneeded(); !removed) {
    log::warn("cannot remove deleted assets", {{"error", removed.error().message()}});
  }
  return {};
}

// A result that a job is answered from is read first, where that does not hold up all writers:
// what is known to be damaged is not used again, but made anew.
void Service::verify_reusable(const Caller& caller, const JobRequest& request) {
  const auto ids = jobs_.reusable(caller, request);
  if (!ids) return;  // submit() says why
  for (const std::string& id : *ids) {
    if (const auto blob = blobs_.verified(id); !blob) return;
  }
}

Result<JobStatus> Service::submit(const Caller& caller, const JobRequest& request,
                                  const SubmitOptions& options) {
  if (draining_) {
    return Error{ErrorCode::kShuttingDown, "the daemon is shutting down; try again", "", ""};
  }
  verify_reusable(caller, request);
  VOXELD_ASSIGN(JobStore::Submitted submitted,
                jobs_.submit(caller, request, options,
                             {config_.queued_jobs_max, limits(caller).queued_jobs}));
  JobRecord& record = submitted.record;
  if (submitted.existed) {
    overlay(record.status);
    return record.status;
  }
  metrics_.submitted(record.status);
  log::info("job submitted", {{"job", record.status.id},
                              {"tenant", record.tenant},
                              {"request", options.request_id},
                              {"trace", options.trace_id},
                              {"kind", job_kind_name(record.status.kind)}});
  if (record.status.ended()) {
    job_changed(record);
  } else {
    const JobStatus& status = record.status;
    forecast_.changed(record, input_bytes(record.asset_tenant, status.asset, status.grid));
    update_gauges();
    if (record.status.deadline_at_ms != 0) deadlines_->look();
    tasks_->notify_work();
  }
  overlay(record.status);
  return record.status;
}

Result<JobStatus> Service::get(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id, JobTexts::kBrief));
  overlay(record.status);
  return std::move(record.status);
}

Result<JobStatus> Service::get_whole(const Caller& caller, std::string_view id) {
  whole_reads_.acquire();
  const auto release = [](std::counting_semaphore<kWholeReadsMax>* reads) { reads->release(); };
  const std::unique_ptr<std::counting_semaphore<kWholeReadsMax>, decltype(release)> held(
      &whole_reads_, release);
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id));
  overlay(record.status);
  return std::move(record.status);
}

Status Service::list(const Caller& caller, const JobQuery& query,
                     const std::function<bool(const JobStatus&)>& take) {
  JobQuery brief = query;
  brief.texts = JobTexts::kBrief;
  return jobs_.list(caller, brief, [&](JobRecord&& record) -> Result<bool> {
    overlay(record.status);
    return take(record.status);
  });
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
    VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id, JobTexts::kBrief));
    overlay(record.status);
    const auto now = Clock::now();
    if (record.status.ended() || now >= deadline) return std::move(record.status);
    if (abandoned && abandoned()) {
      if (record.transient) return cancel(caller, id);
      return std::move(record.status);
    }
    watch.wait(record.status.version, std::min(deadline, now + kWaitSlice));
  }
}

Result<std::vector<JobEvent>> Service::events_after(const Caller& caller, std::string_view id,
                                                    int64_t after_id) {
  // The status first: a state change that comes after it is then in the list, and the older
  // progress is left out. After a full batch there may be more changes.
  VOXELD_ASSIGN(const JobStatus status, get(caller, id));
  VOXELD_ASSIGN(std::vector<JobEvent> events, jobs_.events(caller, id, after_id));
  const int64_t last = events.empty() ? after_id : events.back().id;
  const bool is_all = static_cast<int64_t>(events.size()) < JobStore::kEventsReadMax;
  if (is_all && status.state == JobState::kRunning && status.version > last) {
    events.push_back({status.version, "progress", job_row_text(status)});
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
  VOXELD_ASSIGN(JobRecord before, jobs_.get(caller, id, JobTexts::kBrief));
  if (before.status.ended()) return std::move(before.status);
  VOXELD_ASSIGN(JobRecord record, jobs_.cancel(caller, id));
  if (record.status.ended()) {
    job_changed(record);
  } else {
    board_.request_cancel(record.status.id);
    overlay(record.status);
  }
  return record.status;
}

Result<StoredBlob> Service::stored(std::string_view id, std::string_view what) {
  VOXELD_ASSIGN(BlobInfo blob, named_blob(blobs_, id, what, "submit the job again"));
  retention_.touch(blob.id);
  return StoredBlob{std::move(blob.id), blob.bytes, blobs_.path_of(id)};
}

Result<StoredBlob> Service::result_of(const JobStatus& status) {
  if (status.result) return stored(status.result->blob, "the result of the job " + status.id);
  return Error{ErrorCode::kConflict, "the job " + status.id + " has no result", "done",
               std::string(job_state_name(status.state))};
}

Result<StoredBlob> Service::get_grid(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(const bool known, jobs_.is_grid(caller, id));
  if (!known) {
    return Error{ErrorCode::kNotFound, "no such grid", "the id of a grid",
                 std::string(id.substr(0, 80))};
  }
  return stored(id, "the grid " + std::string(id));
}

Result<JobFrames> Service::frames(const Caller& caller, std::string_view job,
                                  const FrameRange& range) {
  VOXELD_ASSIGN(const JobStatus status, get(caller, job));
  JobFrames frames{status.id,
                   status.result ? status.result->sequence : "",
                   status.frames_done,
                   status.frames_total,
                   {}};
  VOXELD_ASSIGN(frames.frames, frames_.of_job(job, range));
  const bool is_asked = range.count > 0 && frames.frames.empty();
  if (!is_asked || frames.sequence.empty()) return frames;
  // Answered from another job's result.
  VOXELD_ASSIGN(SequenceManifest manifest, frames_.read(caller, frames.sequence));
  const auto count = static_cast<int64_t>(manifest.frames.size());
  for (int64_t i = range.first; i < std::min(count, range.first + range.count); ++i) {
    frames.frames.push_back({i, std::move(manifest.frames[static_cast<size_t>(i)])});
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
    for (WorkerState& state : states) {
      state.restarts = supervisor->restarts(state.device, state.slot);
    }
  }
  const auto place = [this](const WorkerState& state) {
    const auto& devices = config_.devices;
    return std::pair(std::find(devices.begin(), devices.end(), state.device), state.slot);
  };
  std::stable_sort(states.begin(), states.end(),
                   [&](const WorkerState& a, const WorkerState& b) { return place(a) < place(b); });
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
  try {
    VOXELD_ASSIGN(UniqueFd lock, prepare_data_dir(config.data_dir));
    VOXELD_ASSIGN(BlobStore blobs, BlobStore::open(config.data_dir));
    VOXELD_ASSIGN(PartStore parts, PartStore::open(config.data_dir));
    VOXELD_ASSIGN(auto database, Database::open(config.data_dir / "jobs.sqlite"));
    auto service =
        std::make_unique<Service>(config, std::move(lock), std::move(blobs), std::move(parts),
                                  std::move(database), std::move(metrics));
    VOXELD_TRY(service->start());
    return std::unique_ptr<JobService>(std::move(service));
  } catch (const std::exception& failure) {  // no memory, no threads
    return exception_error(failure);
  }
}

}  // namespace voxeld
