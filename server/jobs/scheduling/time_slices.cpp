#include "server/jobs/scheduling/time_slices.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <set>
#include <utility>

namespace voxeld {
namespace {

// Tags of tenants that are not ahead of V are those of tenants that never were there; above this
// number they are looked through.
constexpr size_t kTagsKept = 256;

std::string gigabytes(int64_t bytes) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.1f",
                                   static_cast<double>(std::max<int64_t>(bytes, 0)) / 1e9);
  return {text.data(), static_cast<size_t>(length)};
}

// 0 is none, which comes last.
uint64_t deadline_order(int64_t deadline_at_ms) {
  return deadline_at_ms == 0 ? UINT64_MAX : static_cast<uint64_t>(deadline_at_ms);
}

}  // namespace

void TimeSlices::begin_task(const SliceTask& task) {
  auto started = std::make_shared<Started>();
  started->task = task;
  if (config_.cpu_seconds) started->cpu_seconds = config_.cpu_seconds(task.pid);
  MutexLock lock(mutex_);
  devices_[task.device];  // there from now on
  Task& place = tasks_[task.id];
  if (place != nullptr) end(*place);  // a lost attempt, whose end is told after the next claim
  place = std::move(started);
  grant_free();
}

void TimeSlices::end_task(std::string_view id, int64_t fence) {
  MutexLock lock(mutex_);
  const Task task = find(id, fence);
  if (task == nullptr) return;
  end(*task);
  tasks_.erase(tasks_.find(id));
  grant_free();
}

bool TimeSlices::take_away(std::string_view id) {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  if (found == tasks_.end() || !found->second->is_granted) return false;
  end_slice(*found->second);
  grant_free();
  return true;
}

void TimeSlices::charge_cpu() {
  MutexLock lock(mutex_);
  for (const auto& [id, task] : tasks_) charge_cpu(*task);
}

void TimeSlices::charge_lost_worker(const std::string& device, const std::string& tenant) {
  MutexLock lock(mutex_);
  charge(devices_[device], tenant, kLostWorkerSeconds);
}

void TimeSlices::set_device_bytes(const std::string& device, int64_t bytes_max) {
  MutexLock lock(mutex_);
  devices_[device].bytes_max = bytes_max;
  grant_free();
}

void TimeSlices::set_queued(const std::string& device, std::set<std::string, std::less<>> tenants) {
  MutexLock lock(mutex_);
  for (const auto& [id, task] : tasks_) {
    if (task->task.device == device) tenants.insert(task->task.tenant);
  }
  devices_[device].shares.set_wanting(std::move(tenants));
}

double TimeSlices::share(const std::string& device, const std::string& tenant) const {
  MutexLock lock(mutex_);
  const auto found = devices_.find(device);
  if (found == devices_.end()) return 0;
  const Started* holder = found->second.holder;
  const double had = found->second.shares.of(tenant);
  if (holder == nullptr || holder->task.tenant != tenant) return had;
  const std::chrono::duration<double> held = config_.now() - holder->granted_at;
  return had + held.count() / static_cast<double>(weight_of(tenant));
}

Result<TimeSlices::Outcome> TimeSlices::take(std::string_view id, int64_t fence,
                                             const SliceNeed& need, const Stop& stop) {
  MutexLock lock(mutex_);
  const Task task = find(id, fence);
  if (task == nullptr) return Outcome::kFenced;
  end_slice(*task);
  if (!task->has_memory || task->reserved_bytes > 0) {
    const int64_t reserved = std::exchange(task->reserved_bytes, 0);
    const bool is_covered = task->has_memory && need.host_bytes <= reserved;
    task->has_memory = false;
    task->need = {std::max(need.host_bytes, reserved), need.device_bytes};
    VOXELD_TRY(check_fits(*task));
    // More memory of the host than it has comes in the order of all.
    const auto all = memories(*task, [](const Started&) { return true; });
    task->has_memory = is_covered && std::ranges::all_of(all, &Memory::fits);
  }
  return wait(task, lock, stop);
}

TimeSlices::Outcome TimeSlices::reserve(std::string_view id, int64_t fence, int64_t host_bytes,
                                        const Stop& stop) {
  MutexLock lock(mutex_);
  const Task task = find(id, fence);
  if (task == nullptr) return Outcome::kFenced;
  const int64_t bytes_max = config_.host_bytes_max;
  task->reserved_bytes = bytes_max > 0 ? std::min(host_bytes, bytes_max) : host_bytes;
  task->need = {task->reserved_bytes, 0};
  const Outcome outcome = wait(task, lock, stop);
  end_slice(*task);
  grant_free();
  return outcome;
}

TimeSlices::Outcome TimeSlices::renew(std::string_view id, int64_t fence, const Stop& stop) {
  MutexLock lock(mutex_);
  const Task task = find(id, fence);
  if (task == nullptr) return Outcome::kFenced;
  end_slice(*task);
  return wait(task, lock, stop);
}

void TimeSlices::give(std::string_view id, int64_t fence) {
  MutexLock lock(mutex_);
  const Task task = find(id, fence);
  if (task == nullptr) return;
  end_slice(*task);
  grant_free();
}

bool TimeSlices::is_waiting(std::string_view id) const {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  return found != tasks_.end() && found->second->is_waiting;
}

std::string TimeSlices::waiting_for(std::string_view id) const {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  if (found == tasks_.end() || !found->second->is_waiting) return "";
  const Started& task = *found->second;
  if (!task.has_memory && !may_have_memory(task)) {
    const auto all = memories(task, [](const Started&) { return true; });
    const auto scarce =
        std::find_if(all.begin(), all.end(), [](const Memory& one) { return !one.fits(); });
    // If it would fit, others that came before it wait for memory, too.
    const Memory& told = scarce == all.end() ? all.front() : *scarce;
    return std::string(told.name()) + ": needs " + gigabytes(told.need) + " GB, " +
           gigabytes(told.bytes_max - told.used) + " of " + gigabytes(told.bytes_max) + " GB free";
  }
  const Device& device = devices_.find(task.task.device)->second;
  std::set<std::string_view> before;
  if (device.holder != nullptr) before.insert(device.holder->task.tenant);
  for (const Started* other : waiting_in_order(task.task.device)) {
    if (other == &task) break;
    before.insert(other->task.tenant);
  }
  const bool is_own = before.erase(task.task.tenant) > 0;
  std::string text = "a time slice on " + task.task.device;
  if (before.empty()) return text + (is_own ? ": another job of the tenant before" : "");
  return text + ": " + std::to_string(before.size()) +
         (before.size() == 1 ? " tenant before" : " tenants before");
}

int64_t TimeSlices::granted_bytes(std::string_view id) const {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  return found != tasks_.end() && found->second->has_memory ? found->second->need.host_bytes : 0;
}

int64_t TimeSlices::needed_bytes(std::string_view id) const {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  return found != tasks_.end() ? found->second->need.host_bytes : 0;
}

int64_t TimeSlices::device_us(std::string_view id) const {
  MutexLock lock(mutex_);
  const auto found = tasks_.find(id);
  if (found == tasks_.end()) return 0;
  const Started& task = *found->second;
  if (!task.is_granted) return task.device_us;
  using std::chrono::microseconds;
  return task.device_us +
         std::chrono::duration_cast<microseconds>(config_.now() - task.granted_at).count();
}

TimeSlices::Task TimeSlices::find(std::string_view id, int64_t fence) const {
  const auto found = tasks_.find(id);
  if (found == tasks_.end() || found->second->task.fence != fence) return nullptr;
  return found->second;
}

Status TimeSlices::check_fits(const Started& task) const {
  for (const Memory& one : memories(task, [](const Started&) { return false; })) {
    if (one.fits()) continue;
    return Error{ErrorCode::kGridTooLarge,
                 "the request needs more " + std::string(one.name()) + " than there is for jobs",
                 "at most " + gigabytes(one.bytes_max) + " GB",
                 "about " + gigabytes(one.need) + " GB"};
  }
  return {};
}

TimeSlices::Outcome TimeSlices::wait(const Task& task, MutexLock& lock, const Stop& stop) {
  const auto stops = [&] {
    const int64_t deadline = task->task.deadline_at_ms;
    const bool has_passed =
        deadline != 0 && config_.deadline_now_ms && config_.deadline_now_ms() >= deadline;
    return has_passed || (stop && stop());
  };
  while (!task->is_granted) {
    if (task->has_ended || stops()) {
      task->is_waiting = false;
      grant_free();  // those who could not pass it
      return task->has_ended ? Outcome::kFenced : Outcome::kStopped;
    }
    // At first, and where it was taken away again before this thread saw that it was granted.
    if (!task->is_waiting) {
      task->is_waiting = true;
      task->waits_since = ++events_;
      grant_free();
    } else {
      task->changed.wait_for(lock, kPoll);
    }
  }
  return Outcome::kGranted;
}

void TimeSlices::charge_cpu(Started& task) {
  if (!config_.cpu_seconds || task.task.pid == 0) return;
  const double now = config_.cpu_seconds(task.task.pid);
  if (now < 0) return;  // what it used since the last call is lost with it
  const double used = std::max(now - std::exchange(task.cpu_seconds, now), 0.0);
  if (task.is_granted || used == 0) return;
  charge(devices_[task.task.device], task.task.tenant, used / config_.cores);
  if (config_.charged_cpu) config_.charged_cpu(task.task, used);
}

void TimeSlices::charge(Device& device, const std::string& tenant, double seconds) {
  device.finish[tenant] = tag_of(device, tenant) + seconds / static_cast<double>(weight_of(tenant));
  device.shares.charge(tenant, seconds, weight_of(tenant));
}

void TimeSlices::end(Started& task) {
  end_slice(task);
  charge_cpu(task);
  task.has_ended = true;
  task.changed.notify_all();
}

void TimeSlices::end_slice(Started& task) {
  if (!task.is_granted) return;
  charge_cpu(task);
  task.is_granted = false;
  Device& device = devices_[task.task.device];
  device.holder = nullptr;
  const auto held = config_.now() - task.granted_at;
  const double seconds = std::chrono::duration<double>(held).count();
  task.device_us += std::chrono::duration_cast<std::chrono::microseconds>(held).count();
  // CPU time of the tenant's other tasks may have been charged meanwhile.
  double& finish = device.finish[task.task.tenant];
  finish =
      std::max(task.start_tag, finish) + seconds / static_cast<double>(weight_of(task.task.tenant));
  device.shares.charge(task.task.tenant, seconds, weight_of(task.task.tenant));
  if (config_.charged) config_.charged(task.task, seconds);
}

void TimeSlices::grant_free() {
  for (auto& [name, device] : devices_) {
    if (device.holder != nullptr) continue;
    for (const Started* first : waiting_in_order(name)) {
      if (!first->has_memory && !may_have_memory(*first)) continue;
      grant(*tasks_.find(first->task.id)->second);
      break;
    }
  }
}

void TimeSlices::grant(Started& task) {
  charge_cpu(task);
  Device& device = devices_[task.task.device];
  task.start_tag = tag_of(device, task.task.tenant);
  device.now_tag = task.start_tag;
  device.holder = &task;
  if (device.finish.size() > kTagsKept) forget_old_tags(device);
  task.is_waiting = false;
  task.is_granted = true;
  if (!task.has_memory) {
    task.has_memory = true;
    task.admitted_at = ++events_;
  }
  task.granted_at = config_.now();
  task.changed.notify_all();
}

void TimeSlices::forget_old_tags(Device& device) {
  std::erase_if(device.finish, [&](const auto& entry) { return entry.second <= device.now_tag; });
}

std::vector<const TimeSlices::Started*> TimeSlices::waiting_in_order(
    const std::string& device) const {
  std::vector<std::pair<Order, const Started*>> found;
  for (const auto& [id, task] : tasks_) {
    if (task->is_waiting && task->task.device == device) {
      found.emplace_back(order_of(*task), task.get());
    }
  }
  std::sort(found.begin(), found.end());
  std::vector<const Started*> waiting;
  waiting.reserve(found.size());
  for (const auto& [order, task] : found) waiting.push_back(task);
  return waiting;
}

double TimeSlices::tag_of(const Device& device, const std::string& tenant) const {
  const auto found = device.finish.find(tenant);
  return found == device.finish.end() ? device.now_tag : std::max(device.now_tag, found->second);
}

template <typename Counts>
std::vector<TimeSlices::Memory> TimeSlices::memories(const Started& task, Counts counts) const {
  const auto device = devices_.find(task.task.device);
  Memory host{false, config_.host_bytes_max, 0, task.need.host_bytes};
  Memory on_device{true, device == devices_.end() ? 0 : device->second.bytes_max, 0,
                   task.need.device_bytes};
  for (const auto& [id, other] : tasks_) {
    if (other.get() == &task || !other->has_memory || !counts(*other)) continue;
    host.used += other->need.host_bytes;
    if (other->task.device == task.task.device) on_device.used += other->need.device_bytes;
  }
  return {host, on_device};
}

bool TimeSlices::may_have_memory(const Started& task) const {
  for (const Memory& one : memories(task, [](const Started&) { return true; })) {
    if (!one.fits()) return false;
  }
  const bool is_alone = std::none_of(tasks_.begin(), tasks_.end(),
                                     [](const auto& entry) { return entry.second->has_memory; });
  if (is_alone) return true;  // whatever the order, someone goes on
  const Order order = order_of(task);
  for (const auto& [id, other] : tasks_) {
    if (other.get() == &task || !other->is_waiting || other->has_memory) continue;
    const bool is_beside = other->task.device == task.task.device;
    const bool is_first =
        is_beside ? order_of(*other) < order : other->waits_since < task.waits_since;
    if (is_first && !leaves_room(task, *other)) return false;
  }
  return true;
}

bool TimeSlices::leaves_room(const Started& task, const Started& passed) const {
  const uint64_t since = passed.waits_since;
  for (Memory one :
       memories(passed, [since](const Started& third) { return third.admitted_at > since; })) {
    if (!one.is_device) {
      one.used += task.need.host_bytes;
    } else if (task.task.device == passed.task.device) {
      one.used += task.need.device_bytes;
    }
    if (!one.fits()) return false;
  }
  return true;
}

TimeSlices::Order TimeSlices::order_of(const Started& task) const {
  const SliceTask& it = task.task;
  if (!config_.is_fair) return {0, 0, 0, 0, it.seq};
  // All tasks of a tenant stand at one place among those of others.
  uint64_t first = task.waits_since;
  for (const auto& [id, other] : tasks_) {
    const bool is_beside =
        other->is_waiting && other->task.tenant == it.tenant && other->task.device == it.device;
    if (is_beside) first = std::min(first, other->waits_since);
  }
  const Device& device = devices_.find(it.device)->second;
  return {tag_of(device, it.tenant), first, -it.priority, deadline_order(it.deadline_at_ms),
          it.seq};
}

int64_t TimeSlices::weight_of(const std::string& tenant) const {
  return config_.weight_of ? std::max<int64_t>(1, config_.weight_of(tenant)) : 1;
}

}  // namespace voxeld
