// Worker processes for each device, started again whenever they end.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/base/thread_annotations.h"
#include "server/process/child_process.h"

namespace voxeld {

struct SupervisorConfig {
  std::string executable;  // run as: executable worker --gateway G --device D …
  std::string gateway;     // "unix:/…/tasks.sock"
  std::vector<std::string> devices;
  int workers_per_device = 1;
  int reserve_max = 0;                 // that keep_reserve() may ask for
  int extra_max = 0;                   // that set_extra() may ask for
  std::vector<std::string> arguments;  // appended
  // Called after a worker has ended and before the next one starts.
  std::function<void(const std::string& device, const ExitReason& reason)> on_exit;
};

// Thread-safe. Each slot of a device has a thread that starts its worker, waits for it and starts
// the next one, after a pause that doubles while workers end within kHealthySeconds without a task.
// Slots other than 0 begin when start_others() was called: the first worker is ready as soon as if
// it was alone, and where a device cannot be opened that is tried once.
class Supervisor {
 public:
  static constexpr double kBackoffSecondsMin = 0.05;
  static constexpr double kBackoffSecondsMax = 10.0;
  static constexpr double kHealthySeconds = 5.0;  // a worker that lived so long resets the pause
  static constexpr int kExitContextLost = 4;
  static constexpr int kExitDeviceUnavailable = 3;  // see worker.h: the longest pause at once

  explicit Supervisor(SupervisorConfig config);
  // As stop(0).
  ~Supervisor();
  // Workers that end from now on are not started again.
  void start_no_more();
  // SIGTERM to all, SIGKILL to those that still run after `grace_seconds`; returns when all are
  // reaped.
  void stop(double grace_seconds);

  // A worker of the device is connected.
  void start_others(const std::string& device);
  // Runs so many more workers of each device, from when its first one is connected; never fewer
  // than before.
  void keep_reserve(int workers_per_device);
  int reserve() const;
  // Runs so many more workers of one device. If there were more, those of
  // the highest slots are not started again once they end.
  void set_extra(const std::string& device, int workers);
  // SIGKILL to a worker of ours, and at once the next one in its slot: that counts as no restart.
  void replace(int64_t pid);
  // The worker gets a task. If it ends, its job may be the cause, which has few attempts: jobs of
  // others do not wait for a long pause.
  void has_task(int64_t pid);
  // The slot of a worker that is ours; nullopt for others.
  std::optional<int> slot_of(int64_t pid) const;

  // How a worker that was ours ended, waiting up to `wait` for that. nullopt: it runs still, or it
  // was never ours.
  std::optional<ExitReason> exit_reason(int64_t pid, std::chrono::milliseconds wait);
  // SIGKILL, if the process is a worker of ours. A worker that ignores a cancel ends like this.
  bool kill_worker(int64_t pid);
  int64_t restarts(const std::string& device, int slot) const;

 private:
  struct Slot {
    std::string device;
    int number = 0;
    std::vector<std::string> arguments;  // of its processes
    ChildProcess child;
    // Guarded by the supervisor's mutex_. The number stays until the exit is on record, so that
    // exit_reason() sees one or the other.
    int64_t pid = 0;
    int64_t restarts = 0;
    bool is_replaced = false;  // its worker ends because replace() said so
    bool had_task = false;     // its worker, or the last one
    std::thread thread;
  };
  void run(Slot& slot);
  // False when stopping.
  bool wait_to_start(const Slot& slot) EXCLUDES(mutex_);
  bool pause(double seconds) EXCLUDES(mutex_);
  bool is_ours(int64_t pid) const REQUIRES(mutex_);
  bool may_start(const Slot& slot) const REQUIRES(mutex_);
  bool had_task(const Slot& slot) EXCLUDES(mutex_);
  // Whether the worker was replaced.
  bool note_exit(Slot& slot, const ExitReason& reason) EXCLUDES(mutex_);

  const SupervisorConfig config_;
  mutable Mutex mutex_;
  CondVar changed_;
  bool stopping_ GUARDED_BY(mutex_) = false;
  int reserve_ GUARDED_BY(mutex_) = 0;
  std::map<std::string, int, std::less<>> extra_ GUARDED_BY(mutex_);  // by device
  std::set<std::string, std::less<>> opened_
      GUARDED_BY(mutex_);                            // devices whose first worker is up
  std::deque<ExitReason> exits_ GUARDED_BY(mutex_);  // newest last, kExitsKept
  std::vector<std::unique_ptr<Slot>> slots_;         // fixed after construction
};

}  // namespace voxeld
