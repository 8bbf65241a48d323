#include "server/jobs/workers/supervisor.h"

#include <signal.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "server/base/clock.h"
#include "server/base/guard.h"
#include "server/base/log.h"

namespace voxeld {
namespace {

constexpr size_t kExitsKept = 64;

}  // namespace

Supervisor::Supervisor(SupervisorConfig config) : config_(std::move(config)) {
  const int slots_max = config_.workers_per_device + config_.reserve_max + config_.extra_max;
  for (int number = 0; number < slots_max; ++number) {
    for (const std::string& device : config_.devices) {
      auto slot = std::make_unique<Slot>();
      slot->device = device;
      slot->number = number;
      slot->arguments = {"worker", "--gateway", config_.gateway, "--device", device};
      slot->arguments.insert(slot->arguments.end(), config_.arguments.begin(),
                             config_.arguments.end());
      slots_.push_back(std::move(slot));
    }
  }
  try {
    for (auto& slot : slots_) slot->thread = std::thread([this, &slot = *slot] { run(slot); });
  } catch (...) {  // no memory, too many threads: those that run use this object
    stop(0);
    throw;
  }
}

Supervisor::~Supervisor() {
  stop(0);
}

void Supervisor::run(Slot& slot) {
  double backoff = kBackoffSecondsMin;
  while (wait_to_start(slot)) {
    {
      // Under the lock: stop() either prevents this start or sees the child.
      MutexLock lock(mutex_);
      if (stopping_) return;
      guarded("the start of a worker", [&] {
        if (Status started = slot.child.spawn(config_.executable, slot.arguments); !started) {
          log::error("cannot start a worker",
                     {{"device", slot.device}, {"error", started.error().message()}});
        }
      });
      slot.pid = slot.child.pid();
      slot.had_task = false;
    }
    const Stopwatch watch;
    ExitReason reason;
    bool is_replaced = false;
    if (slot.child.pid() != 0) {
      guarded("the start of a worker", [&] {
        log::info("worker started",
                  {{"device", slot.device}, {"slot", slot.number}, {"pid", slot.child.pid()}});
      });
      reason = slot.child.wait();
      guarded("the end of a worker", [&] { is_replaced = note_exit(slot, reason); });
    }
    if (is_replaced) continue;
    if (watch.ms() >= kHealthySeconds * 1000.0 || had_task(slot)) backoff = kBackoffSecondsMin;
    if (reason.signal == 0 && reason.status == kExitDeviceUnavailable) backoff = kBackoffSecondsMax;
    if (!pause(backoff)) return;
    backoff = std::min(backoff * 2, kBackoffSecondsMax);
  }
}

bool Supervisor::note_exit(Slot& slot, const ExitReason& reason) {
  bool stopping = false, is_replaced = false;
  {
    MutexLock lock(mutex_);
    slot.pid = 0;
    stopping = stopping_;
    is_replaced = std::exchange(slot.is_replaced, false);
    if (!stopping && !is_replaced) ++slot.restarts;
    changed_.notify_all();
    exits_.push_back(reason);
    if (exits_.size() > kExitsKept) exits_.pop_front();
  }
  log::write(stopping || is_replaced ? log::Level::kInfo : log::Level::kWarn, "worker ended",
             {{"device", slot.device}, {"pid", reason.pid}, {"reason", reason.text()}});
  if (!stopping && !is_replaced && config_.on_exit) config_.on_exit(slot.device, reason);
  return is_replaced;
}

bool Supervisor::had_task(const Slot& slot) {
  MutexLock lock(mutex_);
  return slot.had_task;
}

bool Supervisor::may_start(const Slot& slot) const {
  if (slot.number == 0) return true;
  const auto extra = extra_.find(slot.device);
  const int slots =
      config_.workers_per_device + reserve_ + (extra == extra_.end() ? 0 : extra->second);
  return slot.number < slots && opened_.contains(slot.device);
}

bool Supervisor::wait_to_start(const Slot& slot) {
  MutexLock lock(mutex_);
  while (!may_start(slot) && !stopping_) changed_.wait(lock);
  return !stopping_;
}

void Supervisor::start_others(const std::string& device) {
  MutexLock lock(mutex_);
  if (opened_.insert(device).second) changed_.notify_all();
}

void Supervisor::keep_reserve(int workers_per_device) {
  MutexLock lock(mutex_);
  reserve_ = std::clamp(workers_per_device, reserve_, config_.reserve_max);
  changed_.notify_all();
}

int Supervisor::reserve() const {
  MutexLock lock(mutex_);
  return reserve_;
}

void Supervisor::set_extra(const std::string& device, int workers) {
  MutexLock lock(mutex_);
  extra_[device] = std::clamp(workers, 0, config_.extra_max);
  changed_.notify_all();
}

void Supervisor::replace(int64_t pid) {
  MutexLock lock(mutex_);
  for (auto& slot : slots_) {
    if (slot->pid != pid) continue;
    slot->is_replaced = slot->child.send_signal(SIGKILL);
    return;
  }
}

void Supervisor::has_task(int64_t pid) {
  MutexLock lock(mutex_);
  for (auto& slot : slots_) {
    if (slot->pid == pid) slot->had_task = true;
  }
}

std::optional<int> Supervisor::slot_of(int64_t pid) const {
  MutexLock lock(mutex_);
  for (const auto& slot : slots_) {
    if (slot->pid == pid) return slot->number;
  }
  return std::nullopt;
}

bool Supervisor::pause(double seconds) {
  const auto deadline =
      std::chrono::steady_clock::now() +
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds));
  MutexLock lock(mutex_);
  while (!stopping_) {
    if (changed_.wait_until(lock, deadline) == std::cv_status::timeout) return !stopping_;
  }
  return false;
}

void Supervisor::start_no_more() {
  MutexLock lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
}

void Supervisor::stop(double grace_seconds) {
  start_no_more();
  for (auto& slot : slots_) slot->child.send_signal(SIGTERM);
  const Stopwatch watch;
  while (watch.ms() < grace_seconds * 1000.0 &&
         std::any_of(slots_.begin(), slots_.end(),
                     [](const auto& slot) { return slot->child.pid() != 0; })) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  for (auto& slot : slots_) {
    if (slot->child.send_signal(SIGKILL)) {
      log::warn("worker had to be killed", {{"device", slot->device}});
    }
  }
  for (auto& slot : slots_) {
    if (slot->thread.joinable()) slot->thread.join();
  }
}

std::optional<ExitReason> Supervisor::exit_reason(int64_t pid, std::chrono::milliseconds wait) {
  const auto deadline = std::chrono::steady_clock::now() + wait;
  MutexLock lock(mutex_);
  for (bool is_late = false;;) {
    // The newest first: numbers are used again.
    const auto found = std::find_if(exits_.rbegin(), exits_.rend(),
                                    [pid](const ExitReason& exit) { return exit.pid == pid; });
    if (found != exits_.rend()) return *found;
    if (is_late || !is_ours(pid)) return std::nullopt;
    is_late = changed_.wait_until(lock, deadline) == std::cv_status::timeout;
  }
}

bool Supervisor::is_ours(int64_t pid) const {
  return std::any_of(slots_.begin(), slots_.end(),
                     [pid](const auto& slot) { return slot->pid == pid; });
}

bool Supervisor::kill_worker(int64_t pid) {
  for (auto& slot : slots_) {
    if (slot->child.pid() == pid) return slot->child.send_signal(SIGKILL);
  }
  return false;
}

int64_t Supervisor::restarts(const std::string& device, int slot) const {
  MutexLock lock(mutex_);
  for (const auto& known : slots_) {
    if (known->device == device && known->number == slot) return known->restarts;
  }
  return 0;
}

}  // namespace voxeld
