// A connection of the task server, for the files of the task server alone.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "proto/task_bounds.h"
#include "server/base/clock.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/scheduling/slots.h"
#include "server/jobs/workers/message_rate.h"
#include "server/jobs/workers/task_server.h"

namespace voxeld {

// Owned by its thread, but for what is said to be guarded.
struct TaskServer::Connection {
  Connection(int64_t its_number, UniqueFd fd, std::filesystem::path folder,
             double message_seconds_max)
      : number(its_number), socket(std::move(fd), kTaskFrameBytesMax), files(std::move(folder)) {
    socket.distrust(limits::kWorkerMessageBytesMax, message_seconds_max);
  }

  void set_task(std::string id, int64_t new_fence) {
    fence = new_fence;
    MutexLock lock(mutex);
    state.task = std::move(id);
    task_age.lap();
    verdict.reset();
    ended_for.clear();
  }
  Result<std::string> receive() {
    {
      MutexLock lock(mutex);
      silence.emplace();
    }
    auto frame = socket.receive();
    MutexLock lock(mutex);
    silence.reset();
    return frame;
  }
  std::string task() {
    MutexLock lock(mutex);
    return state.task;
  }

  const int64_t number;
  FrameSocket socket;
  MessageRate rate;
  const WorkerFiles files;
  int64_t fence = 0;
  std::string device;
  int64_t pid = 0;
  std::string input;           // hash, of the task
  int64_t deadline_at_ms = 0;  // of the task; 0: none
  TaskProgress progress;       // the last report that said something new …
  Stopwatch since_progress;    // … and its age
  std::string kill_reason;     // why the worker was killed from here, once it was
  std::atomic<bool> ended{false};
  std::thread thread;
  Mutex mutex;
  WorkerState state GUARDED_BY(mutex);
  Stopwatch task_age GUARDED_BY(mutex);
  std::optional<Error> verdict GUARDED_BY(mutex);  // of the watch, on the task that runs
  // Since when the gateway waits for its next message; nullopt while it works on one.
  std::optional<Stopwatch> silence GUARDED_BY(mutex);
  std::string ended_for GUARDED_BY(mutex);  // why the watch ended the worker, once it did

  // Guarded by the server's mutex_: jobs are claimed for a worker on any connection's thread.
  bool is_idle = false;
  bool is_replaced = false;           // its process ends, and another one starts
  IdleSlot idle;                      // what is known of it while it waits
  std::optional<JobRecord> assigned;  // claimed for it; its thread has not seen it yet
  std::optional<StartedJob> started;  // from the claim on until the task ended
  std::chrono::steady_clock::time_point started_at{};
  bool was_asked = false;  // to park it, even if nobody waits any more
};

// The workers of a device that have opened it.
struct TaskServer::DeviceSlots {
  std::vector<IdleSlot> idle;
  std::vector<StartedJob> started;
  int connected = 0;  // those, and what is between two tasks
};

}  // namespace voxeld
