// Time slices of devices. A device works for one task at a time, for one slice; its other
// tasks parse, encode and wait meanwhile.
//
// Among tenants, time slices go by start-time fair queueing (P. Goyal, H. M. Vin, H. Cheng:
// Start-time Fair Queueing, SIGCOMM 1996): a time slice of tenant t has the start tag S = max(V,
// F[t]), the smallest one is next, and when it ends F[t] = S + seconds held / weight[t]; V is the S
// of the time slice that was granted last. Other than in the paper, the tags are of tenants and not
// of packets, for how long a time slice will be is known when it ends. A tenant that was away gets
// no credit for it: its S is V.
//
// Within a tenant: priority, the highest first; the earliest deadline; the order of arrival.
//
// CPU time outside of slices (parsing, decoding, encoding, exports) is charged to the tenant as
// well: a second of CPU time counts as the part of a second of the device that one
// core is of the machine. On device cpu, whose time slices have all cores, both cost the same.
//
// A worker that a job ends costs its tenant kLostWorkerSeconds: another one has to start.
//
// A time slice can be taken away from a worker that gives no sign of life. Should the worker come
// back, it takes a new time slice at its next boundary like any other.
//
// With its first time slice a task tells how much memory it will need in all. One that does not fit
// beside the others waits until it does, and holds no time slice meanwhile. Others may pass it only
// where it fits beside all that have passed it, so that it never waits for them.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/scheduling/tenant_shares.h"

namespace voxeld {

// A started task.
struct SliceTask {
  std::string id;
  int64_t fence = 0;
  std::string device, tenant;
  int priority = 0;
  int64_t deadline_at_ms = 0;  // by TimeSlicesConfig::deadline_now_ms; 0: none
  int64_t seq = 0;             // order of arrival
  int64_t pid = 0;             // of its worker; 0: its CPU time is not known
};

struct SliceNeed {
  int64_t host_bytes = 0, device_bytes = 0;
};

struct TimeSlicesConfig {
  using Clock = std::chrono::steady_clock;
  bool is_fair = true;         // false: in the order of arrival, whoever asks
  int64_t host_bytes_max = 0;  // of all started tasks; 0: not limited
  // At least 1; null: each 1.
  std::function<int64_t(const std::string& tenant)> weight_of;
  // After each time slice; null: nobody. Not to call back.
  std::function<void(const SliceTask& task, double seconds)> charged;
  // CPU time of a process so far; negative: it has ended. null: CPU time is not charged.
  std::function<double(int64_t pid)> cpu_seconds;
  int cores = 1;  // of the machine
  // With each charge of CPU time; null: nobody. Not to call back.
  std::function<void(const SliceTask& task, double cpu_seconds)> charged_cpu;
  std::function<Clock::time_point()> now = [] { return Clock::now(); };  // of what is charged
  std::function<int64_t()> deadline_now_ms;  // of deadlines; null: they do not pass
};

// Thread-safe.
class TimeSlices {
 public:
  enum class Outcome {
    kGranted,
    kStopped,  // `stop` said so, or the deadline has passed
    kFenced,   // no such task, or not with this fence, or it ended meanwhile
  };
  // Polled while a time slice is waited for, at least every kPoll.
  using Stop = std::function<bool()>;
  static constexpr std::chrono::milliseconds kPoll{20};
  static constexpr double kLostWorkerSeconds = 1;  // of the device

  explicit TimeSlices(TimeSlicesConfig config) : config_(std::move(config)) {}

  // --- the gateway's side
  // An earlier attempt at the task that has not ended ends now.
  void begin_task(const SliceTask& task) EXCLUDES(mutex_);
  // Gives back its time slice and memory, and ends its waiting calls with kFenced.
  void end_task(std::string_view id, int64_t fence) EXCLUDES(mutex_);
  // Ends the time slice of a task whose worker is silent, and charges it. False: it has none.
  bool take_away(std::string_view id) EXCLUDES(mutex_);
  // Charges the CPU time that tasks have used without a time slice since the last call.
  void charge_cpu() EXCLUDES(mutex_);
  // A job of the tenant has ended a worker of the device.
  void charge_lost_worker(const std::string& device, const std::string& tenant) EXCLUDES(mutex_);
  // How much memory the device has for tasks; 0: not known, not limited.
  void set_device_bytes(const std::string& device, int64_t bytes_max) EXCLUDES(mutex_);
  // Device time of tenants while they wanted it (tenant_shares.h): of those with queued jobs, and
  // of those with started ones.
  void set_queued(const std::string& device, std::set<std::string, std::less<>> tenants)
      EXCLUDES(mutex_);
  double share(const std::string& device, const std::string& tenant) const EXCLUDES(mutex_);
  int64_t weight_of(const std::string& tenant) const;

  // --- a worker's side
  // Blocks. Errors: grid-too-large for what never fits.
  Result<Outcome> take(std::string_view id, int64_t fence, const SliceNeed& need, const Stop& stop)
      EXCLUDES(mutex_);
  // Waits until a task that ran before may have the memory that it took then, at most all that
  // there is for jobs. It has that until its first time slice, whose need is at least as large.
  Outcome reserve(std::string_view id, int64_t fence, int64_t host_bytes, const Stop& stop)
      EXCLUDES(mutex_);
  // Gives the time slice back and takes the next one, which may be at once.
  Outcome renew(std::string_view id, int64_t fence, const Stop& stop) EXCLUDES(mutex_);
  void give(std::string_view id, int64_t fence) EXCLUDES(mutex_);

  // --- for the status of a task
  bool is_waiting(std::string_view id) const EXCLUDES(mutex_);
  // "a time slice on llvmpipe: 2 tenants before", "memory: …"; empty while it does not wait.
  std::string waiting_for(std::string_view id) const EXCLUDES(mutex_);
  // Memory of the host that it has been granted; 0 before its first time slice.
  int64_t granted_bytes(std::string_view id) const EXCLUDES(mutex_);
  // The same, granted or not; 0: it has told no need.
  int64_t needed_bytes(std::string_view id) const EXCLUDES(mutex_);
  // For which it has held its device since begin_task().
  int64_t device_us(std::string_view id) const EXCLUDES(mutex_);

 private:
  using Clock = TimeSlicesConfig::Clock;
  struct Started {
    SliceTask task;
    SliceNeed need;
    bool has_memory = false;
    int64_t reserved_bytes = 0;  // of it, before its first time slice
    bool is_waiting = false, is_granted = false, has_ended = false;
    uint64_t waits_since = 0, admitted_at = 0;  // numbers of events, in their order
    double start_tag = 0;                       // of the time slice it has
    Clock::time_point granted_at{};
    int64_t device_us = 0;
    double cpu_seconds = 0;  // of its worker's process, up to which it is charged
    CondVar changed;
  };
  using Task = std::shared_ptr<Started>;
  struct Device {
    int64_t bytes_max = 0;
    double now_tag = 0;                    // V
    std::map<std::string, double> finish;  // F
    Started* holder = nullptr;
    TenantShares shares;
  };

  Task find(std::string_view id, int64_t fence) const REQUIRES(mutex_);
  Status check_fits(const Started& task) const REQUIRES(mutex_);
  Outcome wait(const Task& task, MutexLock& lock, const Stop& stop) REQUIRES(mutex_);
  // Charges the CPU time since the last call; within a time slice it is part of the time slice.
  void charge_cpu(Started& task) REQUIRES(mutex_);
  void charge(Device& device, const std::string& tenant, double seconds) REQUIRES(mutex_);
  // Ends the task's time slice, charges it, and fences its waiting calls.
  void end(Started& task) REQUIRES(mutex_);
  // Ends the time slice of a task that has one, and charges it.
  void end_slice(Started& task) REQUIRES(mutex_);
  // Grants the time slice of every device that is free.
  void grant_free() REQUIRES(mutex_);
  void grant(Started& task) REQUIRES(mutex_);
  void forget_old_tags(Device& device) REQUIRES(mutex_);
  std::vector<const Started*> waiting_in_order(const std::string& device) const REQUIRES(mutex_);
  double tag_of(const Device& device, const std::string& tenant) const REQUIRES(mutex_);
  // Memory for tasks, its used part, and the need of a task.
  struct Memory {
    bool is_device;
    int64_t bytes_max, used, need;
    std::string_view name() const { return is_device ? "device memory" : "memory"; }
    bool fits() const { return bytes_max == 0 || used + need <= bytes_max; }
  };
  // Memory of the machine and of the device, used by the tasks that `counts` is true of.
  template <typename Counts>
  std::vector<Memory> memories(const Started& task, Counts counts) const REQUIRES(mutex_);
  // It fits now, and leaves room for every task before it that waits for memory.
  bool may_have_memory(const Started& task) const REQUIRES(mutex_);
  // `passed` fits beside it and all that have passed that one already.
  bool leaves_room(const Started& task, const Started& passed) const REQUIRES(mutex_);
  // Smaller ones are first: the tenant's tag and its first wait; priority, deadline, arrival.
  using Order = std::tuple<double, uint64_t, int, uint64_t, int64_t>;
  Order order_of(const Started& task) const REQUIRES(mutex_);

  const TimeSlicesConfig config_;
  mutable Mutex mutex_;
  uint64_t events_ GUARDED_BY(mutex_) = 0;
  std::map<std::string, Device, std::less<>> devices_ GUARDED_BY(mutex_);
  std::map<std::string, Task, std::less<>> tasks_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
