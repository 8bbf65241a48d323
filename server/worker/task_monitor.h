// What the gateway hears while a task runs, and what the task hears from it.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "proto/task_api.h"
#include "server/base/thread_annotations.h"
#include "server/worker/task_client.h"

namespace voxeld {

// Lives as long as one task. A thread of its own reports every kPeriod, so that a long pass is not
// taken for a dead worker, and learns whether to stop. The task's thread calls the rest.
class TaskMonitor {
 public:
  static constexpr std::chrono::milliseconds kPeriod{100};

  // Asked on the threads that call set_stage() and set_progress(), at most every kPeriod.
  using ReadDeviceMemory = std::function<DeviceMemory()>;

  TaskMonitor(TaskClient& client, const Task& task, ReadDeviceMemory device_memory = nullptr);
  // Ends the reports; no message about the task is sent after this.
  ~TaskMonitor();

  void set_stage(std::string_view stage) EXCLUDES(mutex_);
  // False: stop, the result is not wanted.
  bool set_progress(int64_t tiles_done, int64_t tiles_total) EXCLUDES(mutex_);
  void set_frames(int64_t frames_done, int64_t frames_total) EXCLUDES(mutex_);
  // Hands a frame to the gateway, and counts it as done. Sets task and fence of it. From any
  // thread. Errors: cancelled, also where the task belongs to another worker by now; the gateway's
  // words.
  Result<TaskFrameReply> report_frame(TaskFrame frame) EXCLUDES(mutex_);
  // Hands a part (TaskPart) to the gateway. Errors: as report_frame().
  Status report_part(int64_t position, const std::filesystem::path& path);
  // Errors: cancelled.
  Status check() const;
  // For cancel points (server/base/cancel_point.h): what check() looks at.
  const std::atomic<bool>& cancel_flag() const { return cancelled_; }
  // Whether all that the task has done is with the gateway, or will be once it is asked to park;
  // the time until it first was is what its preparation took.
  void set_can_park(bool can_park) EXCLUDES(mutex_);
  // Whether the gateway would have the worker back.
  bool is_asked_to_park() const { return park_asked_; }
  // All that was done is handed over: the task ends here and is queued again. Always an error,
  // cancelled, on which the task unwinds as on a cancel.
  Error park();
  bool is_parked() const { return is_parked_; }
  TaskProgress progress() const EXCLUDES(mutex_);
  // True when nobody waits for a report on this task any more: fenced, or the gateway is gone.
  bool dropped() const { return dropped_; }

 private:
  void run();
  void sample_memory() EXCLUDES(mutex_);
  void report() EXCLUDES(mutex_);

  TaskClient& client_;
  const ReadDeviceMemory device_memory_;
  const std::string task_;
  const int64_t fence_;
  std::atomic<bool> cancelled_{false};
  std::atomic<bool> dropped_{false};
  std::atomic<bool> park_asked_{false};
  std::atomic<bool> is_parked_{false};
  const std::chrono::steady_clock::time_point begun_at_ = std::chrono::steady_clock::now();
  mutable Mutex mutex_;
  CondVar wake_;
  bool ending_ GUARDED_BY(mutex_) = false;
  TaskProgress progress_ GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point sampled_at_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
