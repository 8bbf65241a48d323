// Reports on a running task to the gateway, and receives cancellation and preemption from it.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "proto/messages/task_api.h"
#include "server/base/thread_annotations.h"
#include "server/worker/gateway/task_client.h"

namespace voxeld {

// Lives as long as one task. A thread of its own reports every kPeriod and learns whether to stop,
// so a long pass is not taken for a dead worker. The task's thread calls the rest.
class TaskMonitor {
 public:
  static constexpr std::chrono::milliseconds kPeriod{100};

  // Called on the threads that call set_stage() and set_progress(), at most every kPeriod.
  using ReadDeviceMemory = std::function<DeviceMemory()>;

  TaskMonitor(TaskClient& client, const Task& task, ReadDeviceMemory device_memory = nullptr);
  // Ends the reports; no message about the task is sent afterwards.
  ~TaskMonitor();

  void set_stage(std::string_view stage) EXCLUDES(mutex_);
  // A cancellation point. False: stop, the result is not wanted.
  bool set_progress(int64_t tiles_done, int64_t tiles_total) EXCLUDES(mutex_);
  void set_frames(int64_t frames_done, int64_t frames_total) EXCLUDES(mutex_);
  // Hands a frame to the gateway and counts it as done. Sets the frame's task and fence. Any thread
  // may call it. Errors: cancelled, also if another worker owns the task by now; the gateway's
  // error.
  Result<TaskFrameReply> report_frame(TaskFrame frame) EXCLUDES(mutex_);
  // Hands a part (TaskPart) to the gateway. Errors: as report_frame().
  Status report_part(int64_t position, const std::filesystem::path& path);
  // A cancellation point. Errors: cancelled.
  Status check() const;
  // The flag behind check(), for cancellation points (server/base/cancel_point.h).
  const std::atomic<bool>& cancel_flag() const { return cancelled_; }
  // Whether a preemption would lose nothing: the gateway has all finished work, or will have it on
  // request. The time until this is first true is the task's preparation.
  void set_preemptible(bool is_preemptible) EXCLUDES(mutex_);
  // Whether the gateway wants to preempt the task.
  bool is_asked_to_preempt() const { return preempt_asked_; }
  TaskProgress progress() const EXCLUDES(mutex_);
  // True if no report on this task is awaited any more: fenced, or the gateway is gone.
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
  std::atomic<bool> preempt_asked_{false};
  const std::chrono::steady_clock::time_point begun_at_ = std::chrono::steady_clock::now();
  mutable Mutex mutex_;
  CondVar wake_;
  bool ending_ GUARDED_BY(mutex_) = false;
  TaskProgress progress_ GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point sampled_at_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
