// Assigns queued jobs to workers that wait, keeps fresh workers in reserve (worker_isolation.h),
// asks started jobs to give up their workers (preemption.h), and adds workers where none will.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "proto/messages/task_api.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/scheduling/slots.h"
#include "server/jobs/workers/task_context.h"

namespace voxeld {

// A worker that has opened its device.
struct DispatchedWorker {
  int64_t number = 0;  // of its session
  int64_t pid = 0;
  std::string device;
  int slot = 0;                    // among the device's processes
  std::function<bool()> has_left;  // its connection is closed; called under the dispatcher's lock
};

// Thread-safe. A worker's own calls come from its session's thread.
class Dispatcher {
 public:
  // Both outlive it.
  Dispatcher(const TaskServerConfig& config, const TaskServerContext& context)
      : config_(config), context_(context) {}

  // Wakes every waiting worker; wait() returns nullopt from now on.
  void stop() EXCLUDES(mutex_);
  // A job was queued, or put back.
  void notify_work() EXCLUDES(mutex_);

  void add(DispatchedWorker worker) EXCLUDES(mutex_);
  // Nothing is assigned to the worker any more; what was assigned before stays so.
  void retire(int64_t worker) noexcept EXCLUDES(mutex_);
  void remove(int64_t worker) EXCLUDES(mutex_);
  // Waits until a job is claimed for the worker. It stays assigned until accept(), so that whoever
  // ends the session before that puts it back. nullopt: the worker has left or is replaced, or the
  // gateway stops.
  std::optional<JobRecord> wait(int64_t worker) EXCLUDES(claim_mutex_, mutex_);
  // The job that is assigned and not accepted.
  std::optional<JobRecord> assigned(int64_t worker) const EXCLUDES(mutex_);
  void accept(int64_t worker) EXCLUDES(mutex_);
  // The worker's task has ended; its process keeps these inputs and grids of the tenant in caches.
  void end_task(int64_t worker, const std::string& tenant, std::vector<std::string> cached)
      EXCLUDES(mutex_);
  // Takes a report of the worker's task. True: the task is to be preempted, by the last look.
  bool report(int64_t worker, const TaskProgress& progress) EXCLUDES(mutex_);
  // Whether its task was ever asked to be preempted, even if nobody waits any more.
  bool was_asked(int64_t worker) const EXCLUDES(mutex_);
  std::string tenant_of(int64_t worker) const EXCLUDES(mutex_);  // of its task; empty: none
  // Looks which tenants wait while all workers are busy: some of these are to give up their tasks,
  // or the device gets one more. Called several times a second, whatever workers report.
  void look_who_waits() EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  using Tenants = std::set<std::string, std::less<>>;
  struct Worker {
    DispatchedWorker info;
    bool is_idle = false;
    bool is_replaced = false;  // its process ends, and another one starts
    IdleSlot idle;             // what is known of it while it waits
    std::optional<JobRecord> assigned;
    std::optional<StartedJob> started;  // from the claim on until the task ended
    std::string task;                   // of `started`
    Clock::time_point started_at{};
    bool was_asked = false;
  };
  // The workers of a device.
  struct DeviceSlots {
    std::vector<IdleSlot> idle;
    std::vector<StartedJob> started;
    int connected = 0;  // those, and what is between two tasks
    int extra = 0;
    size_t free = 0;  // tasks that may start now

    void add(const Worker& worker);
  };
  struct Renewal {
    std::optional<Clock::time_point> blocked_since;  // a head of the queue waits for a fresh worker
    Clock::time_point replaced_at{};                 // when a worker was last replaced
  };

  // Workers that a device has beyond its usual ones (kExtraWorkersMax).
  struct Extra {
    int workers = 0;
    std::optional<Clock::time_point> left_out_since;  // a tenant waits for one more
    Clock::time_point changed_at{};
  };

  // --- waiting
  void begin_waiting(int64_t worker) EXCLUDES(mutex_);
  bool has_to_leave(int64_t worker) const EXCLUDES(mutex_);
  void wait_for_work(int64_t worker, uint64_t seen) EXCLUDES(mutex_);
  uint64_t work_epoch() const EXCLUDES(mutex_);
  std::string device_of(int64_t worker) const EXCLUDES(mutex_);
  const Worker* find(int64_t worker) const REQUIRES(mutex_);
  Worker* find(int64_t worker) REQUIRES(mutex_);

  // --- claims
  // Claims jobs for those workers of the device that wait. is_poll: also where nothing changed.
  void assign_jobs(const std::string& device, bool is_poll) EXCLUDES(claim_mutex_, mutex_);
  DeviceSlots slots_of(const std::string& device) const EXCLUDES(mutex_);
  HeadChoice choose_head(const std::string& device, const DeviceSlots& slots,
                         const std::vector<QueueHead>& heads);
  bool assign(std::vector<IdleSlot> idle, const JobRecord& record) EXCLUDES(mutex_);
  bool put_back_unassigned() REQUIRES(claim_mutex_);
  // Puts back the running jobs that no worker has.
  void put_back_lost() REQUIRES(claim_mutex_) EXCLUDES(mutex_);
  std::set<std::string> known_tasks() const REQUIRES(claim_mutex_) EXCLUDES(mutex_);
  static Tenants tenants_of(const std::vector<QueueHead>& heads);

  // --- isolation
  WorkerIsolation isolation() const;
  int reserve() const;
  size_t free_slots(const std::string& device, const DeviceSlots& slots) const REQUIRES(mutex_);
  bool is_free_slot_left() const REQUIRES(mutex_);
  // `blocked`: heads of the queue that wait for fresh workers; nullopt: nobody looked.
  void note_blocked(const std::string& device, std::optional<int> blocked) REQUIRES(claim_mutex_);
  void renew_workers(const std::string& device, int blocked) REQUIRES(claim_mutex_)
      EXCLUDES(mutex_);
  void replace(const std::vector<int64_t>& workers) EXCLUDES(mutex_);

  // --- preemption
  void choose_preempted(const std::string& device, const std::vector<QueueHead>& heads)
      EXCLUDES(mutex_);
  // --- extra workers
  int extra_of(const std::string& device) const REQUIRES(mutex_);
  void set_extra(const std::string& device, int workers) REQUIRES(mutex_);
  void add_extra(const std::string& device, bool is_left_out) REQUIRES(mutex_);
  void drop_extra(const std::string& device) EXCLUDES(mutex_);
  std::vector<Worker*> busy_workers(const std::string& device, std::vector<StartedJob>& started)
      REQUIRES(mutex_);

  const TaskServerConfig& config_;
  const TaskServerContext& context_;
  std::atomic<bool> stopping_{false};

  // One thread claims at a time, before mutex_.
  Mutex claim_mutex_;
  // By device: the work_epoch_ after which its workers have looked into the queue.
  std::map<std::string, uint64_t> claimed_epoch_ GUARDED_BY(claim_mutex_);
  std::optional<JobRecord> unassigned_ GUARDED_BY(claim_mutex_);  // claimed, and nobody's task yet
  std::map<std::string, Renewal> renewals_ GUARDED_BY(claim_mutex_);  // by device

  mutable Mutex mutex_;
  CondVar work_;
  uint64_t work_epoch_ GUARDED_BY(mutex_) = 0;
  std::map<int64_t, Worker> workers_ GUARDED_BY(mutex_);   // by number
  std::map<std::string, Extra> extra_ GUARDED_BY(mutex_);  // by device
  int64_t tasks_ended_ GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld
