// The task server's claims: a worker waits, a job is claimed for it, its task is told.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/base/log.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/results.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/workers/task_connection.h"

namespace voxeld {
namespace {

// A worker that waits for work is looked at so often, to notice that it has died.
constexpr std::chrono::milliseconds kIdlePoll{200};
// Waiting workers look into the queue so often even when nobody told them of work.
constexpr int kIdlePollsPerClaim = 10;

}  // namespace

Status TaskServer::give_task(Connection& connection) {
  if (!connection.task().empty()) {
    return Error{ErrorCode::kBadRequest, "claim while a task runs", "complete or fail", "claim"};
  }
  begin_waiting(connection);
  for (int polls = 0;; ++polls) {
    const uint64_t seen = work_epoch();
    // A worker that died while it waited must not cost the next job an attempt.
    if (stopping_ || connection.socket.peer_closed() || is_replaced(connection)) {
      end_waiting(connection);
      return Error{ErrorCode::kGone, "connection closed, or the gateway stops", "", ""};
    }
    assign_jobs(connection.device, polls % kIdlePollsPerClaim == 0);
    const std::optional<JobRecord> record = take_assigned(connection);
    if (!record) {
      wait_for_work(connection, seen);
      continue;
    }
    const auto task = make_task(connection.files, *record);
    if (task) return send_task(connection, *record, *task);
    connection.files.clear();
    VOXELD_TRY(refuse_task(*record, task.error()));
    connection.set_task("", 0);
    begin_waiting(connection);
  }
}

uint64_t TaskServer::work_epoch() const {
  MutexLock lock(mutex_);
  return work_epoch_;
}

void TaskServer::begin_waiting(Connection& connection) {
  MutexLock lock(mutex_);
  connection.is_idle = true;
  connection.started.reset();
  ++work_epoch_;  // one more slot is free, which may let others' jobs in
  work_.notify_all();
}

bool TaskServer::is_replaced(const Connection& connection) const {
  MutexLock lock(mutex_);
  return connection.is_replaced;
}

// put_back() finds a task that was assigned meanwhile.
void TaskServer::end_waiting(Connection& connection) {
  MutexLock lock(mutex_);
  connection.is_idle = false;
}

// From here on the end of this connection puts the job back: it is either assigned or the task.
std::optional<JobRecord> TaskServer::take_assigned(Connection& connection) {
  MutexLock lock(mutex_);
  if (!connection.assigned) return std::nullopt;
  std::optional<JobRecord> record = connection.assigned;
  connection.set_task(record->status.id, record->fence);
  connection.assigned.reset();
  return record;
}

void TaskServer::wait_for_work(const Connection& connection, uint64_t seen) {
  MutexLock lock(mutex_);
  if (work_epoch_ == seen && !connection.assigned && !stopping_) work_.wait_for(lock, kIdlePoll);
}

void TaskServer::assign_jobs(const std::string& device, bool is_poll) {
  const MutexLock claims(claim_mutex_);
  const uint64_t epoch = work_epoch();
  // Another worker of the device has looked since something changed.
  if (!is_poll && claimed_epoch_[device] == epoch) return;
  std::optional<int> blocked;  // nullopt: nobody has looked into the queue
  while (!stopping_ && put_back_unassigned()) {
    const DeviceSlots slots = slots_of(device);
    if (free_slots(slots) == 0) break;
    const auto pick = [&](const std::vector<QueueHead>& heads) {
      const HeadChoice choice = choose_head(device, slots, heads);
      blocked = choice.blocked;
      return choice.head;
    };
    auto claimed = context_.jobs.claim(device, pick,
                                       config_.is_fair ? QueueOrder::kFair : QueueOrder::kArrival);
    if (!claimed) {
      log::error("cannot claim a job", {{"error", claimed.error().message()}});
      std::this_thread::sleep_for(std::chrono::seconds(1));
      return;
    }
    if (!claimed->has_value()) break;
    if ((*claimed)->status.ended()) {  // an equal job's result was there
      context_.job_changed(**claimed);
      continue;
    }
    unassigned_ = **std::move(claimed);
    if (assign(slots.idle, *unassigned_)) unassigned_.reset();
  }
  note_blocked(device, blocked);
  renew_workers(device, blocked.value_or(0));
  claimed_epoch_[device] = epoch;
}

HeadChoice TaskServer::choose_head(const std::string& device, const DeviceSlots& slots,
                                   const std::vector<QueueHead>& heads) {
  const WorkerIsolation isolated = isolation();
  if (config_.is_fair) {
    context_.turns.set_queued(device, tenants_of(heads));
    return pick_runnable_head(
        heads, slots.idle, free_slots(slots), slots.started, isolated,
        [&](const std::string& tenant) { return context_.turns.share(device, tenant); });
  }
  if (heads.empty()) return {};
  return can_run(slots.idle, isolated, heads[0]) ? HeadChoice{0, 0} : HeadChoice{std::nullopt, 1};
}

// A job that was claimed and that no worker could be given, for it had gone or for want of memory.
// False: that cannot be stored now, and nothing is claimed until it can.
bool TaskServer::put_back_unassigned() {
  if (!unassigned_) return true;
  const auto back =
      context_.jobs.lose_worker(unassigned_->status.id, unassigned_->fence, "", false, {});
  if (!back) {
    log::error("cannot put a job back", {{"error", back.error().message()}});
    return false;
  }
  unassigned_.reset();
  if (*back) context_.job_changed(**back);
  return true;
}

TaskServer::DeviceSlots TaskServer::slots_of(const std::string& device) const {
  MutexLock lock(mutex_);
  DeviceSlots slots;
  for (const auto& connection : connections_) {
    if (connection->idle.connection == 0 || connection->device != device) continue;
    ++slots.connected;
    if (connection->started) slots.started.push_back(*connection->started);
    if (connection->is_idle && !connection->is_replaced && !connection->socket.peer_closed()) {
      slots.idle.push_back(connection->idle);
    }
  }
  return slots;
}

// One of the idle workers that may run it, as of when they were looked at.
bool TaskServer::assign(std::vector<IdleSlot> idle, const JobRecord& record) {
  const JobStatus& status = record.status;
  const std::string& input = !status.grid.empty()       ? status.grid
                             : !status.sequence.empty() ? status.sequence
                                                        : status.asset;
  const WorkerIsolation isolated = isolation();
  std::erase_if(idle, [&](const IdleSlot& slot) {
    return !slot.past.may_run(isolated, record.tenant, record.asset_tenant);
  });
  if (idle.empty()) return false;  // isolation has begun meanwhile
  const int64_t wanted = idle[pick_slot(idle, record.tenant, input)].connection;
  MutexLock lock(mutex_);
  for (const auto& connection : connections_) {
    if (connection->number != wanted || !connection->is_idle || connection->is_replaced) continue;
    StartedJob started;
    started.tenant = record.tenant;
    started.priority = status.priority;
    started.deadline_ms = status.deadline_at_ms == 0 ? kNoDeadline : status.deadline_at_ms;
    started.seq = record.seq;
    started.device_seconds = status.device_ms / 1000.0;
    connection->assigned = record;
    connection->started = std::move(started);
    connection->started_at = std::chrono::steady_clock::now();
    connection->was_asked = false;
    connection->is_idle = false;
    connection->idle.past.add(record.tenant, record.asset_tenant);
    work_.notify_all();
    return true;
  }
  return false;
}

// The path by which the worker finds an input. The blob is verified first, once per process.
Result<std::string> TaskServer::hand_over(const WorkerFiles& files, std::string_view id,
                                          std::string_view what) {
  const bool is_asset = what == "asset";
  VOXELD_ASSIGN(const BlobInfo blob,
                named_blob(context_.blobs, id, "the " + std::string(what) + " " + std::string(id),
                           is_asset ? "upload the same bytes again, then submit the job again"
                                    : "submit the job that made it again"));
  return files.hand_over(context_.blobs.path_of(blob.id));
}

Result<Task> TaskServer::make_task(const WorkerFiles& files, const JobRecord& record) {
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
  VOXELD_ASSIGN(task.input_path, hand_over(files, task.input_hash,
                                           task.input_is_grid       ? "grid"
                                           : task.input_is_sequence ? "sequence"
                                                                    : "asset"));
  task.filename = status.filename;
  task.options_json = status.options_json;
  task.tenant = record.tenant;
  if (config_.limits_of) task.cells_max = config_.limits_of(record.tenant).cells;
  task.request_id = record.request_id;
  task.trace_id = record.trace_id;
  if (task.input_is_sequence) {
    VOXELD_ASSIGN(const SequenceManifest manifest, context_.frames.read_blob(status.sequence));
    for (const SequenceFrame& frame : manifest.frames) {
      VOXELD_ASSIGN(task.frame_paths.emplace_back(), hand_over(files, frame.grid, "grid"));
    }
  }
  if (!status.asset.empty()) {
    VOXELD_ASSIGN(const auto bundled,
                  context_.assets.bundle_files(record.asset_tenant, status.asset));
    for (const BundleFile& file : bundled) {
      VOXELD_ASSIGN(task.bundle_paths.emplace_back(), hand_over(files, file.asset, "asset"));
    }
  }
  VOXELD_TRY(add_done(files, record, task));
  return task;
}

// Adds the work of earlier attempts: parts, and frames from the first one on.
Status TaskServer::add_done(const WorkerFiles& files, const JobRecord& record, Task& task) {
  for (const std::filesystem::path& part : context_.parts.of_job(task.id)) {
    VOXELD_ASSIGN(task.part_paths.emplace_back(), files.hand_over(part));
  }
  if (record.status.frames_total == 0) return {};
  VOXELD_ASSIGN(const std::vector<ListedFrame> frames, context_.frames.of_job(task.id));
  for (const ListedFrame& listed : frames) {
    const SequenceFrame& frame = listed.frame;
    const bool follows = listed.index == static_cast<int64_t>(task.done_frames.size());
    if (!follows || !context_.blobs.verified(frame.grid)) break;
    VOXELD_ASSIGN(std::string path, files.hand_over(context_.blobs.path_of(frame.grid)));
    task.done_frames.push_back(
        {frame.grid, std::move(path), frame.time_s, frame.voxel_count, frame.content_hash});
  }
  return {};
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
  connection.input = task.input_hash;
  connection.deadline_at_ms = status.deadline_at_ms;
  context_.turns.begin_task({status.id, record.fence, connection.device, record.tenant,
                             status.priority, status.deadline_at_ms, record.seq, connection.pid});
  if (status.attempt == 1 && status.parked == 0) {
    context_.metrics.waited(record.tenant,
                            static_cast<double>(status.started_ms - status.created_ms) / 1000.0);
  }
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
  const nlohmann::json reply = {{"task", to_json_message(task)}};
  return connection.socket.send(
      reply.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace voxeld
