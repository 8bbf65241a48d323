#include "server/jobs/workers/dispatcher.h"

#include <algorithm>
#include <iterator>
#include <thread>
#include <utility>

#include "server/base/log.h"
#include "server/jobs/scheduling/preemption.h"

namespace voxeld {
namespace {

// A worker that waits for work is looked at so often, to notice that it has died.
constexpr std::chrono::milliseconds kIdlePoll{200};
// Waiting workers look into the queue so often even when nobody told them of work.
constexpr int kIdlePollsPerClaim = 10;
// If a process that should be starting does not come, one more is replaced after so long, as
// long as a job waits for it.
constexpr std::chrono::seconds kReplacePeriod{5};
// A worker is added where a tenant was left out for so long, and goes when nobody has needed it for
// so long.
constexpr std::chrono::seconds kExtraAfter{1}, kExtraKept{10};

const std::string& input_of(const JobStatus& status) {
  if (!status.grid.empty()) return status.grid;
  return status.sequence.empty() ? status.asset : status.sequence;
}

}  // namespace

void Dispatcher::stop() {
  stopping_ = true;
  notify_work();
}

void Dispatcher::notify_work() {
  MutexLock lock(mutex_);
  ++work_epoch_;
  work_.notify_all();
}

void Dispatcher::add(DispatchedWorker worker) {
  MutexLock lock(mutex_);
  Worker& added = workers_[worker.number];
  added.idle.connection = worker.number;
  added.idle.slot = worker.slot;
  added.info = std::move(worker);
}

void Dispatcher::retire(int64_t worker) noexcept {
  MutexLock lock(mutex_);
  if (Worker* known = find(worker)) known->is_idle = false;
}

void Dispatcher::remove(int64_t worker) {
  MutexLock lock(mutex_);
  workers_.erase(worker);
}

const Dispatcher::Worker* Dispatcher::find(int64_t worker) const {
  const auto found = workers_.find(worker);
  return found == workers_.end() ? nullptr : &found->second;
}

Dispatcher::Worker* Dispatcher::find(int64_t worker) {
  const auto found = workers_.find(worker);
  return found == workers_.end() ? nullptr : &found->second;
}

std::string Dispatcher::device_of(int64_t worker) const {
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  return known == nullptr ? std::string() : known->info.device;
}

std::optional<JobRecord> Dispatcher::wait(int64_t worker) {
  begin_waiting(worker);
  const std::string device = device_of(worker);
  for (int polls = 0;; ++polls) {
    const uint64_t seen = work_epoch();
    // A worker that died while it waited must not cost the next job an attempt.
    if (has_to_leave(worker)) {
      retire(worker);
      return std::nullopt;
    }
    assign_jobs(device, polls % kIdlePollsPerClaim == 0);
    if (auto record = assigned(worker)) return record;
    wait_for_work(worker, seen);
  }
}

uint64_t Dispatcher::work_epoch() const {
  MutexLock lock(mutex_);
  return work_epoch_;
}

void Dispatcher::begin_waiting(int64_t worker) {
  MutexLock lock(mutex_);
  Worker* known = find(worker);
  if (known == nullptr) return;
  known->is_idle = true;
  known->started.reset();
  ++work_epoch_;  // one more slot is free, which may let others' jobs in
  work_.notify_all();
}

bool Dispatcher::has_to_leave(int64_t worker) const {
  if (stopping_) return true;
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  return known == nullptr || known->is_replaced || known->info.has_left();
}

std::optional<JobRecord> Dispatcher::assigned(int64_t worker) const {
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  return known == nullptr ? std::nullopt : known->assigned;
}

void Dispatcher::accept(int64_t worker) {
  MutexLock lock(mutex_);
  if (Worker* known = find(worker)) known->assigned.reset();
}

void Dispatcher::wait_for_work(int64_t worker, uint64_t seen) {
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  const bool has_task = known != nullptr && known->assigned;
  if (work_epoch_ == seen && !has_task && !stopping_) work_.wait_for(lock, kIdlePoll);
}

void Dispatcher::end_task(int64_t worker, const std::string& tenant,
                          std::vector<std::string> cached) {
  MutexLock lock(mutex_);
  Worker* known = find(worker);
  if (known == nullptr) return;
  known->started.reset();
  known->idle.tenant = tenant;
  known->idle.has = std::move(cached);
  known->idle.ended_at = ++tasks_ended_;
}

std::string Dispatcher::tenant_of(int64_t worker) const {
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  return known != nullptr && known->started ? known->started->tenant : std::string();
}

// --- claims

void Dispatcher::assign_jobs(const std::string& device, bool is_poll) {
  const MutexLock claims(claim_mutex_);
  const uint64_t epoch = work_epoch();
  // Another worker of the device has looked since something changed.
  if (!is_poll && claimed_epoch_[device] == epoch) return;
  if (is_poll) put_back_lost();
  std::optional<int> blocked;  // nullopt: nobody has looked into the queue
  while (!stopping_ && put_back_unassigned()) {
    const DeviceSlots slots = slots_of(device);
    if (slots.free == 0) break;
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
  if (is_poll) drop_extra(device);
  claimed_epoch_[device] = epoch;
}

HeadChoice Dispatcher::choose_head(const std::string& device, const DeviceSlots& slots,
                                   const std::vector<QueueHead>& heads) {
  const WorkerIsolation isolated = isolation();
  if (config_.is_fair) {
    context_.slices.set_queued(device, tenants_of(heads));
    return pick_runnable_head(
        heads, slots.idle, slots.free, slots.started, isolated,
        [&](const std::string& tenant) { return context_.slices.share(device, tenant); });
  }
  if (heads.empty()) return {};
  return can_run(slots.idle, isolated, heads[0]) ? HeadChoice{0, 0} : HeadChoice{std::nullopt, 1};
}

// A job that was claimed and that no worker could be given, for it had gone or for want of memory.
// False: that cannot be stored now, and nothing is claimed until it can.
bool Dispatcher::put_back_unassigned() {
  if (!unassigned_) return true;
  const auto back = context_.jobs.lose_worker(unassigned_->status.id, unassigned_->fence, {}, {});
  if (!back) {
    log::error("cannot put a job back", {{"error", back.error().message()}});
    return false;
  }
  unassigned_.reset();
  if (*back) context_.job_changed(**back);
  return true;
}

// A failure of memory or disk may report a claim as failed although it was committed. Without this
// function the job would be running until the daemon restarts. A job that ends between the two
// reads has another fence or state by then and is not changed.
void Dispatcher::put_back_lost() {
  const auto running = context_.jobs.running();
  if (!running) {
    log::error("cannot read the running jobs", {{"error", running.error().message()}});
    return;
  }
  const std::set<std::string> known = known_tasks();
  for (const RunningJob& job : *running) {
    if (known.contains(job.id)) continue;
    const auto back = context_.jobs.lose_worker(job.id, job.fence, {}, context_.live(job.id));
    if (!back) {
      log::error("cannot put a job back", {{"job", job.id}, {"error", back.error().message()}});
    } else if (*back) {
      log::warn("a running job had no worker and is put back", {{"job", job.id}});
      context_.job_changed(**back);
    }
  }
}

std::set<std::string> Dispatcher::known_tasks() const {
  std::set<std::string> known;
  if (unassigned_) known.insert(unassigned_->status.id);
  MutexLock lock(mutex_);
  for (const auto& [number, worker] : workers_) {
    if (worker.assigned) known.insert(worker.assigned->status.id);
    if (worker.started) known.insert(worker.task);
  }
  return known;
}

void Dispatcher::DeviceSlots::add(const Worker& worker) {
  ++connected;
  if (worker.started) started.push_back(*worker.started);
  if (worker.is_idle && !worker.is_replaced && !worker.info.has_left()) idle.push_back(worker.idle);
}

Dispatcher::DeviceSlots Dispatcher::slots_of(const std::string& device) const {
  MutexLock lock(mutex_);
  DeviceSlots slots;
  for (const auto& [number, worker] : workers_) {
    if (worker.info.device == device) slots.add(worker);
  }
  slots.extra = extra_of(device);
  slots.free = free_slots(device, slots);
  return slots;
}

// Gives the job to one of the idle workers that may run it, as of when they were looked at.
bool Dispatcher::assign(std::vector<IdleSlot> idle, const JobRecord& record) {
  const JobStatus& status = record.status;
  const WorkerIsolation isolated = isolation();
  std::erase_if(idle, [&](const IdleSlot& slot) {
    return !slot.past.may_run(isolated, record.tenant, record.asset_tenant);
  });
  if (idle.empty()) return false;  // isolation has begun meanwhile
  const int64_t wanted = idle[pick_slot(idle, record.tenant, input_of(status))].connection;
  StartedJob started;
  started.tenant = record.tenant;
  started.priority = status.priority;
  started.deadline_ms = record.deadline_ms;
  started.seq = record.seq;
  started.device_seconds = status.device_ms / 1000.0;
  JobRecord assigned = record;
  std::string task = status.id;
  MutexLock lock(mutex_);
  Worker* worker = find(wanted);
  if (worker == nullptr || !worker->is_idle || worker->is_replaced) return false;
  worker->idle.past.add(record.tenant, record.asset_tenant);
  const auto extra = extra_.find(worker->info.device);
  if (extra != extra_.end()) extra->second.left_out_since.reset();
  // From here on nothing allocates: the worker has all of the job, or nothing.
  worker->assigned = std::move(assigned);
  worker->started = std::move(started);
  worker->task = std::move(task);
  worker->started_at = Clock::now();
  worker->was_asked = false;
  worker->is_idle = false;
  work_.notify_all();
  return true;
}

// --- isolation

WorkerIsolation Dispatcher::isolation() const {
  return config_.isolation ? config_.isolation() : WorkerIsolation::kNone;
}

int Dispatcher::reserve() const {
  return config_.reserve ? config_.reserve() : 0;
}

// Tasks that may start now. Workers of others than the daemon add to those that it runs itself.
size_t Dispatcher::free_slots(const std::string& device, const DeviceSlots& slots) const {
  const int held_back = reserve();
  if (held_back == 0) return slots.idle.size();
  const int places =
      std::max(config_.workers_per_device + extra_of(device), slots.connected - held_back);
  const int free = places - static_cast<int>(slots.started.size());
  return std::min(slots.idle.size(), static_cast<size_t>(std::max(free, 0)));
}

// Whether any device could start one more task.
bool Dispatcher::is_free_slot_left() const {
  std::map<std::string, DeviceSlots> devices;
  for (const auto& [number, worker] : workers_) devices[worker.info.device].add(worker);
  for (const auto& [device, slots] : devices) {
    if (free_slots(device, slots) > 0) return true;
  }
  return false;
}

void Dispatcher::note_blocked(const std::string& device, std::optional<int> blocked) {
  Renewal& renewal = renewals_[device];
  const auto now = Clock::now();
  if (blocked > 0 && !renewal.blocked_since) renewal.blocked_since = now;
  if (blocked == 0 && renewal.blocked_since) {
    const std::chrono::duration<double> waited = now - *std::exchange(renewal.blocked_since, {});
    context_.metrics.waited_for_fresh_worker(device, waited.count());
  }
}

// Keeps as many fresh workers as the reserve has, and one for each blocked head.
void Dispatcher::renew_workers(const std::string& device, int blocked) {
  const DeviceSlots slots = slots_of(device);
  Renewal& renewal = renewals_[device];
  const auto now = Clock::now();
  const auto since = std::max(renewal.blocked_since.value_or(now), renewal.replaced_at);
  const bool is_late = blocked > 0 && now - since > kReplacePeriod;
  const int processes = config_.workers_per_device + reserve() + slots.extra;
  const int coming = is_late ? 0 : std::max(0, processes - slots.connected);
  const std::vector<int64_t> replaced =
      workers_to_replace(slots.idle, isolation(), reserve() + blocked, coming);
  if (replaced.empty()) return;
  renewal.replaced_at = now;
  replace(replaced);
}

void Dispatcher::replace(const std::vector<int64_t>& workers) {
  std::vector<int64_t> pids;
  {
    MutexLock lock(mutex_);
    for (const int64_t number : workers) {
      Worker* worker = find(number);
      // It may have got a task since.
      if (worker == nullptr || !worker->is_idle || worker->is_replaced) continue;
      worker->is_replaced = true;
      pids.push_back(worker->info.pid);
      context_.metrics.worker_replaced(worker->info.device);
      // Under the lock: a session that sees the mark ends its connection, and a process that left
      // before it is known as replaced counts as a crash.
      if (config_.replace_worker) config_.replace_worker(worker->info.pid);
    }
    ++work_epoch_;
    work_.notify_all();
  }
  for (const int64_t pid : pids) log::info("worker is replaced", {{"pid", pid}});
}

// --- preemption

Dispatcher::Tenants Dispatcher::tenants_of(const std::vector<QueueHead>& heads) {
  Tenants tenants;
  for (const QueueHead& head : heads) tenants.insert(head.tenant);
  return tenants;
}

bool Dispatcher::report(int64_t worker, const TaskProgress& progress) {
  MutexLock lock(mutex_);
  Worker* known = find(worker);
  if (known == nullptr || !known->started) return false;
  known->started->is_preemptible = progress.is_preemptible;
  known->started->preparation_seconds = static_cast<double>(progress.preparation_ms) / 1000.0;
  return known->started->is_asked;
}

bool Dispatcher::was_asked(int64_t worker) const {
  MutexLock lock(mutex_);
  const Worker* known = find(worker);
  return known != nullptr && known->was_asked;
}

void Dispatcher::look_who_waits() {
  if (!config_.is_fair) return;
  std::set<std::string> devices;
  {
    MutexLock lock(mutex_);
    // A tenant without a worker gets one where a slot is free on any device.
    if (is_free_slot_left()) return;
    for (const auto& [number, worker] : workers_) {
      if (worker.started) devices.insert(worker.info.device);
    }
  }
  if (devices.empty()) return;
  const auto heads = context_.jobs.queue_heads();
  if (!heads) return;  // claims tell of it
  for (const std::string& device : devices) choose_preempted(device, *heads);
}

// The jobs that workers of the device have, with what is known of them now.
std::vector<Dispatcher::Worker*> Dispatcher::busy_workers(const std::string& device,
                                                          std::vector<StartedJob>& started) {
  const auto now = Clock::now();
  std::vector<Worker*> busy;
  for (auto& [number, worker] : workers_) {
    if (!worker.started || worker.info.device != device) continue;
    StartedJob job = *worker.started;
    job.slot_seconds = std::chrono::duration<double>(now - worker.started_at).count();
    job.device_seconds += static_cast<double>(context_.slices.device_us(worker.task)) / 1e6;
    started.push_back(std::move(job));
    busy.push_back(&worker);
  }
  return busy;
}

// Asks the started jobs of the device whose workers other tenants need more.
void Dispatcher::choose_preempted(const std::string& device, const std::vector<QueueHead>& heads) {
  context_.slices.set_queued(device, tenants_of(heads));
  std::vector<StartedJob> started;
  MutexLock lock(mutex_);
  const std::vector<Worker*> busy = busy_workers(device, started);
  const PreemptionView view{
      heads,
      started,
      [&](const std::string& tenant) { return context_.slices.share(device, tenant); },
      [&](const std::string& tenant) {
        return static_cast<double>(context_.slices.weight_of(tenant));
      },
      [&](const std::string& job) {
        return config_.expected_seconds ? config_.expected_seconds(job) : 0.0;
      },
      context_.jobs.deadline_now_ms()};
  add_extra(device, is_left_out(view));
  const std::vector<size_t> preempted = jobs_to_preempt(view);
  for (size_t i = 0; i < busy.size(); ++i) {
    const bool is_asked = std::find(preempted.begin(), preempted.end(), i) != preempted.end();
    busy[i]->started->is_asked = is_asked;
    busy[i]->was_asked |= is_asked;
  }
}

// --- extra workers

int Dispatcher::extra_of(const std::string& device) const {
  const auto found = extra_.find(device);
  return found == extra_.end() ? 0 : found->second.workers;
}

void Dispatcher::set_extra(const std::string& device, int workers) {
  Extra& extra = extra_[device];
  extra.workers = workers;
  extra.left_out_since.reset();
  extra.changed_at = Clock::now();
  config_.set_extra(device, workers);
  log::info("workers of a device",
            {{"device", device}, {"usual", config_.workers_per_device}, {"extra", workers}});
  ++work_epoch_;  // a fresh worker in reserve may take a task at once
  work_.notify_all();
}

// All workers of the device are busy.
void Dispatcher::add_extra(const std::string& device, bool is_left_out) {
  if (!config_.set_extra) return;
  Extra& extra = extra_[device];
  if (!is_left_out) return extra.left_out_since.reset();
  const auto now = Clock::now();
  if (!extra.left_out_since) extra.left_out_since = now;
  if (now - *extra.left_out_since < kExtraAfter || extra.workers == kExtraWorkersMax) return;
  set_extra(device, extra.workers + 1);
}

// Ends an idle worker in a slot that the device no longer has, or in its highest one where a place
// stays free without it.
void Dispatcher::drop_extra(const std::string& device) {
  const DeviceSlots slots = slots_of(device);
  std::optional<int64_t> dropped;
  {
    MutexLock lock(mutex_);
    const auto found = extra_.find(device);
    if (found == extra_.end()) return;
    const Extra& extra = found->second;
    const int places = config_.workers_per_device + extra.workers;
    const int highest = places + reserve() - 1;
    const bool is_needed = extra.workers == 0 || std::ssize(slots.started) + 2 > places ||
                           Clock::now() - extra.changed_at < kExtraKept;
    for (const IdleSlot& idle : slots.idle) {
      if (idle.slot < highest || (idle.slot == highest && is_needed)) continue;
      dropped = idle.connection;
      if (idle.slot == highest) set_extra(device, extra.workers - 1);
      break;
    }
  }
  if (dropped) replace({*dropped});
}

}  // namespace voxeld
