#include "server/jobs/service/job_service.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <utility>

#include "proto/asset_id.h"
#include "proto/messages/job_text.h"
#include "server/base/clock.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/events/job_log.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/service/service.h"

namespace voxeld {

void Service::overlay(JobStatus& status) {
  board_.overlay(status);
  if (status.state == JobState::kQueued) status.waiting_for = "a worker";
  if (status.state == JobState::kRunning) {
    status.waiting_for = slices_.waiting_for(status.id);
    status.device_ms += static_cast<double>(slices_.device_us(status.id)) / 1000.0;
  }
  forecast_.fill(status);
}

// The change is durable: a step that fails must not keep the next ones from being done.
void Service::job_changed(const JobRecord& record) noexcept {
  const JobStatus& status = record.status;
  const auto step = [](const auto& work) { guarded_twice("the change of a job", work); };
  step([&] { forecast_.changed(record); });
  step([&] { log_job_change(record); });
  if (status.ended()) {
    job_ended(record);
  } else if (status.state == JobState::kRunning) {
    step([&] { metrics_.claimed(status); });
  } else if (record.was_preempted) {
    step([&] { metrics_.preempted(status, record.tenant); });
  } else {
    step([&] { metrics_.requeued(status); });
  }
  step([&] { update_gauges(); });
}

void Service::job_ended(const JobRecord& record) noexcept {
  const JobStatus& status = record.status;
  const auto step = [](const auto& work) { guarded_twice("the end of a job", work); };
  step([&] { parts_.remove(status.id); });
  step([&] { metrics_.ended(status, record.tenant, record.worker); });
  step([&] { board_.changed(status.id, status.version, false); });
  step([&] {
    // If they were deleted meanwhile, they stayed for the job.
    for (const std::string& input : {status.grid, status.sequence}) {
      if (!input.empty()) blobs_.suspect(input);
    }
    if (status.sequence.empty()) return;
    const Status left = let_go(results_.drop_leftovers(status.sequence));
    if (!left) log::warn("frames may stay behind", {{"error", left.error().message()}});
  });
  step([&] { sweep_.look_at_deleted(); });
}

void Service::update_gauges() {
  const auto live = jobs_.live();
  if (live) metrics_.set_jobs(live->queued, live->running);
}

Status Service::let_go(const Result<ResultStore::Ids>& ids) {
  if (!ids) return ids.error();
  for (const std::string& id : *ids) blobs_.suspect(id);
  return {};
}

JobInput Service::job_input(const std::string& tenant, const std::string& asset,
                            const std::string& grid, const std::string& sequence) {
  if (!sequence.empty()) {
    const auto size = frames_.size_of(sequence);
    if (!size || size->frames == 0) return {JobInput::Form::kGrid, 0};
    return {JobInput::Form::kGrid, size->bytes / size->frames, size->frames};
  }
  const auto bytes_of = [this](const std::string& id) {
    const auto blob = blobs_.stat(id);
    return blob ? blob->bytes : int64_t{0};
  };
  if (asset.empty()) return {JobInput::Form::kGrid, bytes_of(grid)};
  JobInput input = file_input(blobs_, AssetId::parse(asset).blob);
  if (const auto files = assets_.bundle_files(tenant, asset)) {
    for (const BundleFile& file : *files) input.bytes += bytes_of(AssetId::parse(file.asset).blob);
  }
  return input;
}

Result<JobStatus> Service::estimate(const Caller& caller, const JobRequest& request) {
  JobRequest filled = request;
  VOXELD_ASSIGN(const bool cached, jobs_.has_result(caller, filled));
  JobStatus estimated =
      forecast_.estimate(caller.tenant(), filled,
                         job_input(caller.tenant(), filled.asset, filled.grid, filled.sequence));
  if (!cached) return estimated;
  estimated.cached = true;
  estimated.queue_position = 0;
  estimated.estimate = JobEstimate{};
  estimated.expected_start_ms = estimated.expected_end_ms = unix_time_ms();
  return estimated;
}

TenantLimits Service::stored_limits(std::string_view tenant) const {
  TenantLimits limits = config_.limits_of ? config_.limits_of(tenant) : TenantLimits{};
  if (limits.bytes == 0 || !config_.held_bytes) return limits;
  limits.bytes = std::max<int64_t>(1, limits.bytes - config_.held_bytes(tenant));  // 0: no limit
  return limits;
}

Result<TenantUsage> Service::usage(const Caller& caller) {
  VOXELD_ASSIGN(TenantUsage usage, jobs_.usage(caller.tenant()));
  if (config_.held_bytes) usage.bytes += config_.held_bytes(caller.tenant());
  return usage;
}

Result<int64_t> Service::upload_room(const Caller& caller, int64_t asked) {
  const int64_t bytes_max = stored_limits(caller.tenant()).bytes;
  if (bytes_max <= 0) return std::numeric_limits<int64_t>::max();
  VOXELD_ASSIGN(const JobStore::UploadRoom room, jobs_.upload_room(caller.tenant(), asked));
  const int64_t left = std::max<int64_t>(0, bytes_max - room.used);
  if (asked == 0) return std::max(left, room.longest_blob);
  if (asked > left && !room.can_be_there) return bytes_error(asked, room.used, bytes_max);
  return std::max(left, asked);
}

Status Service::delete_asset(const Caller& caller, std::string_view id) {
  VOXELD_TRY(assets_.mark_deleted(caller, id));
  // Not on this thread: whether the bytes go too would be told by the time that it takes.
  sweep_.look_at_deleted();
  return {};
}

// Verifies the stored result that a job would reuse, where that does not hold up all writers. A
// damaged result is not reused but made again.
void Service::verify_reusable(const Caller& caller, const JobRequest& request) {
  const auto ids = jobs_.reusable(caller, request);
  if (!ids) return;  // submit() says why
  for (const std::string& id : *ids) {
    if (const auto blob = blobs_.verified(id); !blob) return;
  }
}

QueueLimits Service::queue_limits(const Caller& caller) {
  const TenantLimits own = stored_limits(caller.tenant());
  const bool is_shared = config_.is_queue_shared && config_.is_queue_shared();
  const auto record_bytes_max = blobs_.disk().record_bytes_max();
  return {config_.queued_jobs_max, own.queued_jobs, is_shared, own.bytes,
          record_bytes_max ? *record_bytes_max : 0};
}

Result<JobStatus> Service::submit(const Caller& caller, const JobRequest& request,
                                  const SubmitOptions& options) {
  if (draining_) {
    return Error{ErrorCode::kShuttingDown, "the daemon is shutting down; try again", "", ""};
  }
  // A job that is there needs no room on the disk.
  VOXELD_ASSIGN(auto earlier, jobs_.known(caller, request, options.idempotency_key));
  if (earlier) {
    overlay(earlier->status);
    return std::move(earlier->status);
  }
  VOXELD_TRY(blobs_.disk().for_jobs());
  verify_reusable(caller, request);
  // Its input, or the result that it ends with, may be what a transient job left a moment ago.
  if (!options.transient) VOXELD_TRY(blobs_.sync());
  VOXELD_ASSIGN(JobStore::Submitted submitted,
                jobs_.submit(caller, request, options, queue_limits(caller)));
  JobRecord& record = submitted.record;
  if (submitted.existed) {
    overlay(record.status);
    return record.status;
  }
  job_submitted(record, options);
  overlay(record.status);
  return record.status;
}

// The job is durable: a step that fails must not keep the next ones from being done.
void Service::job_submitted(const JobRecord& record, const SubmitOptions& options) noexcept {
  const JobStatus& status = record.status;
  const auto step = [](const auto& work) { guarded_twice("a submitted job", work); };
  step([&] { metrics_.submitted(status); });
  step([&] {
    for (const std::string& used : {status.grid, status.sequence}) {
      if (!used.empty()) retention_.touch(used);
    }
  });
  step([&] {
    log::info("job submitted", {{"job", status.id},
                                {"tenant", record.tenant},
                                {"request", options.request_id},
                                {"trace", options.trace_id},
                                {"kind", job_kind_name(status.kind)}});
  });
  if (status.ended()) return job_changed(record);
  step([&] { forecast(record); });
  step([&] { update_gauges(); });
  step([&] {
    if (record.deadline_ms != kNoDeadline) deadlines_->look();
  });
  step([&] { tasks_->notify_work(); });
}

// A worker may have taken and ended the job before the forecast knows of it.
void Service::forecast(JobRecord record) {
  const JobStatus& status = record.status;
  const JobInput input = job_input(record.asset_tenant, status.asset, status.grid, status.sequence);
  forecast_.add(record, input);
  do {
    auto now = jobs_.get(Caller::daemon(), record.status.id, JobTexts::kBrief);
    if (now && now->status.version == record.status.version) return;
    if (now) {
      record = *std::move(now);
    } else {
      record.status.state = JobState::kCancelled;  // its record was removed
    }
    forecast_.changed(record);
  } while (!record.status.ended());
}

Result<JobStatus> Service::get(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id, JobTexts::kBrief));
  overlay(record.status);
  return std::move(record.status);
}

Result<JobStatus> Service::get_whole(const Caller& caller, std::string_view id) {
  whole_reads_.acquire();
  const auto release = [](WholeReads* reads) { reads->release(); };
  const std::unique_ptr<WholeReads, decltype(release)> held(&whole_reads_, release);
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id));
  overlay(record.status);
  return std::move(record.status);
}

Status Service::list(const Caller& caller, const JobQuery& query,
                     const std::function<bool(const ListedJob&)>& take) {
  JobQuery brief = query;
  brief.texts = JobTexts::kBrief;
  return jobs_.list(caller, brief, [&](JobRecord&& record) -> Result<bool> {
    overlay(record.status);
    return take(
        {record.seq, std::move(record.tenant), std::move(record.worker), std::move(record.status)});
  });
}

Result<QueueView> Service::queue(const Caller& caller) {
  VOXELD_ASSIGN(QueueView view, queue_view(jobs_, workers(), caller));
  const bool is_only_tenant = caller.tenant().empty();  // the daemon asks for no key
  if (!caller.sees_all() && !is_only_tenant) return view;
  VOXELD_ASSIGN(const int64_t free_bytes, blobs_.disk().free_bytes());
  VOXELD_ASSIGN(const int64_t disk_bytes, blobs_.disk().total_bytes());
  view.store = QueueView::Store{blobs_.bytes(), free_bytes, disk_bytes};
  return view;
}

Result<std::vector<JobEvent>> Service::events(const Caller& caller, std::string_view id,
                                              int64_t after_id) {
  // The status first: a state change that comes after it is then in the list, and the older
  // progress is left out. After a full batch there may be more changes.
  VOXELD_ASSIGN(const JobStatus status, get(caller, id));
  VOXELD_ASSIGN(std::vector<JobEvent> events, jobs_.events(caller, id, after_id));
  const int64_t last = events.empty() ? after_id : events.back().id;
  const bool is_all = std::ssize(events) < JobStore::kEventsReadMax;
  if (is_all && status.state == JobState::kRunning && status.version > last) {
    events.push_back({status.version, "progress", job_row_text(status)});
  }
  return events;
}

Result<JobStatus> Service::cancel(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord before, jobs_.get(caller, id, JobTexts::kBrief));
  if (before.status.ended()) return std::move(before.status);
  VOXELD_ASSIGN(JobStore::Cancelled cancelled, jobs_.cancel(caller, id));
  JobStatus& status = cancelled.record.status;
  if (cancelled.ended_now) {
    job_changed(cancelled.record);
  } else if (!status.ended()) {
    board_.request_cancel(status.id);
    overlay(status);
  }
  return std::move(status);
}

Status Service::forget(const Caller& caller, std::string_view id) {
  VOXELD_TRY(let_go(jobs_.forget(caller, id)));
  // All that stays of the job.
  log::info("job record removed", {{"job", std::string(id)}, {"tenant", caller.tenant()}});
  return {};
}

Result<StoredBlob> Service::stored(std::string_view id, std::string_view what) {
  VOXELD_ASSIGN(BlobInfo blob, named_blob(blobs_, id, what, "submit the job again"));
  retention_.touch(blob.id);
  VOXELD_ASSIGN(std::filesystem::path file, blobs_.local_file(id));
  return StoredBlob{std::move(blob.id), blob.bytes, std::move(file)};
}

Result<JobAndResult> Service::get_with_result(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(JobRecord record, jobs_.get(caller, id, JobTexts::kBrief));
  overlay(record.status);
  const JobStatus& status = record.status;
  auto file = status.result && !record.is_result_gone ? result_file(status) : result_of(status);
  return JobAndResult{std::move(record.status), std::move(file)};
}

Result<StoredBlob> Service::result_file(const JobStatus& status) {
  return stored(status.result->blob, "the result of the job " + status.id);
}

Result<StoredBlob> Service::result_of(const JobStatus& status) {
  if (status.result) {
    VOXELD_TRY(jobs_.check_result(status.id));
    return result_file(status);
  }
  return Error{ErrorCode::kConflict, "the job " + status.id + " has no result", "done",
               std::string(job_state_name(status.state))};
}

Result<StoredBlob> Service::get_grid(const Caller& caller, std::string_view id) {
  VOXELD_TRY(jobs_.check_grid(caller, id));
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
  // The job got another job's result.
  VOXELD_ASSIGN(SequenceManifest manifest, frames_.read(caller, frames.sequence));
  const auto count = std::ssize(manifest.frames);
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
  const auto live = jobs_.live();
  return live ? live->queued : 0;
}

Status Service::ready() {
  if (draining_) return Error{ErrorCode::kShuttingDown, "the daemon is shutting down", "", ""};
  VOXELD_TRY(jobs_.live());
  const std::vector<WorkerState> states = workers();
  if (std::none_of(states.begin(), states.end(),
                   [](const WorkerState& state) { return state.connected; })) {
    std::string reason;
    for (const WorkerState& state : states) {
      if (!state.last_error.empty()) reason = ": " + state.device + ": " + state.last_error;
    }
    return Error{ErrorCode::kDeviceUnavailable, "no worker is connected" + reason, "", ""};
  }
  VOXELD_TRY(blobs_.begin(0));
  return blobs_.disk().for_jobs();
}

}  // namespace voxeld
