#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/service/service.h"
#include "server/process/machine.h"
#include "server/store/data_dir.h"

namespace voxeld {
namespace {

// How long the end of a worker's connection waits for the end of its process, to name the signal.
constexpr std::chrono::milliseconds kExitReasonWait{1000};
// For a worker to give up what it does; then it is killed, and loses nothing but its time.
constexpr double kWorkerGraceSeconds = 0.5;
// Part of the disk that one worker may write without a limit: several workers must not fill it.
constexpr int64_t kScratchPartOfDisk = 4;
// How often the clock of retention is written down; after a crash so much less has passed.
constexpr int64_t kClockNoteMs = 60'000;

}  // namespace

TimeSlicesConfig Service::slices_config() {
  TimeSlicesConfig config;
  config.is_fair = config_.is_fair;
  config.host_bytes_max = config_.memory_bytes_max;
  config.weight_of = config_.weight_of;
  config.charged = [this](const SliceTask& task, double seconds) {
    metrics_.had_slice(task.device, task.tenant, seconds);
  };
  config.cpu_seconds = process_cpu_seconds;
  config.deadline_now_ms = [this] { return clock_.now_ms(); };
  config.cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  config.charged_cpu = [this](const SliceTask& task, double seconds) {
    metrics_.used_cpu(task.tenant, seconds);
  };
  return config;
}

Status Service::start() {
  VOXELD_TRY(keys_.check(config_.has_keys && config_.has_keys(), config_.forgets_keys));
  blobs_.disk().keep_ballast();
  database_->set_make_way([this] { return blobs_.disk().make_way(); });
  VOXELD_ASSIGN(const int64_t recovered, jobs_.recover(clock_.stopped_ms()));
  if (recovered > 0) log::info("jobs of an earlier process recovered", {{"jobs", recovered}});
  if (auto removed = assets_.remove_unneeded(); !removed) {  // the disk may be full just now
    log::warn("cannot remove deleted assets", {{"error", removed.error().message()}});
  }
  // Before any request needs them. Unreadable files stay in the quarantine.
  if (auto restored = retention_.restore_quarantined(); !restored) {
    log::warn("cannot look into the quarantine", {{"error", restored.error().message()}});
  }
  parts_.remove_unless([this](std::string_view id) {
    const auto job = jobs_.get(Caller::daemon(), id);
    return job && !job->status.ended();
  });
  update_gauges();
  forecast_waiting();

  VOXELD_ASSIGN(
      tasks_,
      TaskServer::start(server_config(),
                        {jobs_, assets_, frames_, blobs_, blobs_.disk(), parts_, board_, metrics_,
                         slices_, [this](const JobRecord& record) { job_changed(record); }}));
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
  if (server.limits.scratch_bytes_max == 0) {
    const auto disk_bytes = blobs_.disk().total_bytes();
    server.limits.scratch_bytes_max = disk_bytes ? *disk_bytes / kScratchPartOfDisk : 0;
  }
  server.limits_of = [this](std::string_view tenant) { return stored_limits(tenant); };
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
  server.replace_worker = [this](int64_t pid) {
    if (Supervisor* supervisor = supervising_) supervisor->replace(pid);
  };
  server.isolation = config_.isolation;
  server.workers_per_device = supervised_workers();
  server.reserve = [this] {
    Supervisor* supervisor = supervising_;
    return supervisor == nullptr ? 0 : supervisor->reserve();
  };
  server.set_extra = [this](const std::string& device, int workers) {
    if (Supervisor* supervisor = supervising_) supervisor->set_extra(device, workers);
  };
  server.slot_of = [this](int64_t pid) {
    Supervisor* supervisor = supervising_;
    return supervisor == nullptr ? 0 : supervisor->slot_of(pid).value_or(0);
  };
  server.on_connected = [this](const std::string& device) {
    if (Supervisor* supervisor = supervising_) supervisor->start_others(device);
  };
  server.on_task = [this](int64_t pid) {
    if (Supervisor* supervisor = supervising_) supervisor->has_task(pid);
  };
  return server;
}

void Service::start_supervisor() {
  SupervisorConfig config;
  config.executable = config_.worker_executable;
  config.gateway = "unix:" + (config_.data_dir / "run" / "tasks.sock").string();
  config.devices = config_.devices;
  config.workers_per_device = supervised_workers();
  config.reserve_max = reserve_of(WorkerIsolation::kTask, supervised_workers());
  config.extra_max = config_.is_fair ? kExtraWorkersMax : 0;
  config.arguments = config_.worker_arguments;
  config.on_exit = [this](const std::string& device, const ExitReason&) {
    metrics_.worker_restarted(device);
  };
  supervisor_ = std::make_unique<Supervisor>(std::move(config));
  supervising_ = supervisor_.get();
  keep_reserve();
  // Workers that were connected before that line.
  for (const WorkerState& state : tasks_->workers()) {
    if (state.connected) supervisor_->start_others(state.device);
  }
}

int Service::supervised_workers() const {
  return config_.is_fair ? config_.workers_per_device : 1;
}

// Isolation may begin while the daemon runs, with the key of a second tenant.
void Service::keep_reserve() {
  Supervisor* supervisor = supervising_;
  if (supervisor == nullptr || !config_.isolation) return;
  supervisor->keep_reserve(reserve_of(config_.isolation(), supervised_workers()));
}

// Makes the changes of transient jobs durable: first the blobs, then the rows that name them.
void Service::sync_soon() {
  for (const Status& synced : {blobs_.sync(), database_->sync()}) {
    if (!synced) log::warn("cannot sync the store", {{"error", synced.error().message()}});
  }
}

void Service::note_each_second() {
  keep_reserve();
  sync_soon();
  if (const int64_t now_ms = clock_.now_ms(); now_ms - clock_noted_ms_ >= kClockNoteMs) {
    mark_->note_clock(now_ms, clock_.wall_ms());
    clock_noted_ms_ = now_ms;
  }
  if (config_.has_keys && config_.has_keys()) keys_.remember();
}

Service::~Service() {
  stop();
}

// Each step is done whatever failed before it: the destructor calls this, too.
void Service::stop() {
  const auto step = [](const auto& work) { guarded("the end of the job service", work); };
  draining_ = true;
  step([&] {
    if (deadlines_ != nullptr) deadlines_->stop();
  });
  step([&] { sweep_.stop(); });
  step([&] { mark_->note_clock(clock_.now_ms(), clock_.wall_ms()); });
  step([&] {
    if (supervisor_ != nullptr) supervisor_->start_no_more();
  });
  // First the connections: their tasks go back to the queue, and workers end when theirs closes.
  step([&] {
    if (tasks_ != nullptr) tasks_->stop();
  });
  step([&] { supervising_ = nullptr; });
  step([&] {
    if (supervisor_ != nullptr) supervisor_->stop(kWorkerGraceSeconds);
  });
  step([&] { sync_soon(); });
}

// At start: the jobs that an earlier process left.
void Service::forecast_waiting() {
  JobQuery query;
  query.state = JobState::kQueued;
  const Status listed =
      jobs_.list(Caller::daemon(), query, [&](JobRecord&& record) -> Result<bool> {
        const JobStatus& status = record.status;
        forecast_.add(record,
                      job_input(record.asset_tenant, status.asset, status.grid, status.sequence));
        return true;
      });
  if (!listed) log::warn("cannot forecast waiting jobs", {{"error", listed.error().message()}});
}

Result<std::unique_ptr<JobService>> start_job_service(
    const JobServiceConfig& config, std::shared_ptr<prometheus::Registry> metrics) {
  try {
    VOXELD_ASSIGN(UniqueFd lock, prepare_data_dir(config.data_dir));
    VOXELD_ASSIGN(BlobStore blobs,
                  BlobStore::open(config.data_dir, config.storage.disk_reserve_bytes));
    VOXELD_ASSIGN(PartStore parts, PartStore::open(config.data_dir));
    (void)blobs.disk().make_way();  // SQLite writes while it opens
    VOXELD_ASSIGN(StoreDatabase store, open_store_database(blobs, config.store_match));
    auto service =
        std::make_unique<Service>(config, std::move(lock), std::move(blobs), std::move(parts),
                                  std::move(store), std::move(metrics));
    VOXELD_TRY(service->start());
    return std::unique_ptr<JobService>(std::move(service));
  } catch (const std::exception& failure) {  // no memory, no threads
    return exception_error(failure);
  }
}

}  // namespace voxeld
