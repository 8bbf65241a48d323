#include "server/worker/gateway/task_monitor.h"

#include <chrono>
#include <utility>

#include "server/base/cancel_point.h"

namespace voxeld {

TaskMonitor::TaskMonitor(TaskClient& client, const Task& task, ReadDeviceMemory device_memory)
    : client_(client),
      device_memory_(std::move(device_memory)),
      task_(task.id),
      fence_(task.fence) {
  {
    MutexLock lock(mutex_);
    progress_.task = task.id;
    progress_.fence = task.fence;
    progress_.stage = "parse";
  }
  thread_ = std::thread([this] { run(); });
}

TaskMonitor::~TaskMonitor() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

void TaskMonitor::sample_memory() {
  if (!device_memory_) return;
  const auto now = std::chrono::steady_clock::now();
  {
    MutexLock lock(mutex_);
    if (now - sampled_at_ < kPeriod) return;
    sampled_at_ = now;
  }
  const DeviceMemory memory = device_memory_();
  if (memory.bytes_total == 0) return;
  MutexLock lock(mutex_);
  progress_.device_memory = memory;
}

void TaskMonitor::set_stage(std::string_view stage) {
  sample_memory();
  MutexLock lock(mutex_);
  progress_.stage = stage;
  progress_.tiles_done = progress_.tiles_total = 0;
}

bool TaskMonitor::set_progress(int64_t tiles_done, int64_t tiles_total) {
  sample_memory();
  {
    MutexLock lock(mutex_);
    progress_.tiles_done = tiles_done;
    progress_.tiles_total = tiles_total;
  }
  return !is_cancelled() && !cancelled_;
}

void TaskMonitor::set_frames(int64_t frames_done, int64_t frames_total) {
  MutexLock lock(mutex_);
  progress_.frames_done = frames_done;
  progress_.frames_total = frames_total;
}

Result<TaskFrameReply> TaskMonitor::report_frame(TaskFrame frame) {
  VOXELD_TRY(check());
  frame.task = task_;
  frame.fence = fence_;
  {
    MutexLock lock(mutex_);
    frame.frames_total = progress_.frames_total;
  }
  auto reply = client_.frame(frame);
  if (!reply || reply->fenced) dropped_ = true;
  if (dropped_ || reply->cancel) cancelled_ = true;
  if (!reply) return reply;
  if (reply->fenced) VOXELD_TRY(check());
  // A cancellation stops the later frames; this one is stored.
  MutexLock lock(mutex_);
  ++progress_.frames_done;
  return reply;
}

Status TaskMonitor::report_part(int64_t position, const std::filesystem::path& path) {
  VOXELD_TRY(check());
  const auto reply = client_.part({task_, fence_, position, path.string()});
  if (reply && reply->fenced) dropped_ = true;
  if (dropped_ || (reply && reply->cancel)) cancelled_ = true;
  if (!reply) return reply.error();
  return check();
}

Status TaskMonitor::check() const {
  if (!is_cancelled() && !cancelled_) return {};
  return Error{ErrorCode::kCancelled, "the job was cancelled", "", ""};
}

void TaskMonitor::set_preemptible(bool is_preemptible) {
  MutexLock lock(mutex_);
  progress_.is_preemptible = is_preemptible;
  if (!is_preemptible || progress_.preparation_ms > 0) return;
  const auto took = std::chrono::steady_clock::now() - begun_at_;
  progress_.preparation_ms =
      1 + std::chrono::duration_cast<std::chrono::milliseconds>(took).count();
}

TaskProgress TaskMonitor::progress() const {
  MutexLock lock(mutex_);
  return progress_;
}

void TaskMonitor::run() {
  while (true) {
    {
      const auto deadline = std::chrono::steady_clock::now() + kPeriod;
      MutexLock lock(mutex_);
      while (!ending_ && wake_.wait_until(lock, deadline) != std::cv_status::timeout) {
      }
      if (ending_) return;
    }
    report();
  }
}

void TaskMonitor::report() {
  const auto reply = client_.progress(progress());
  if (!reply || reply->fenced) dropped_ = true;
  if (dropped_ || reply->cancel) cancelled_ = true;
  preempt_asked_ = reply && reply->preempt;
}

}  // namespace voxeld
