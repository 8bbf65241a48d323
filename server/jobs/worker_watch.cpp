#include "server/jobs/worker_watch.h"

#include <cmath>
#include <utility>

#include "server/base/host_memory.h"

namespace voxeld {
namespace {

// The next attempt would take as much, so the job ends at once.
Error too_much_memory(int64_t bytes, int64_t bytes_max) {
  const std::string taken = memory_text(bytes), limit = memory_text(bytes_max);
  return {ErrorCode::kGridTooLarge, "memory: " + taken + ", limit " + limit,
          "work that a worker can do within " + limit, taken};
}

Error too_long(double seconds, double seconds_max) {
  return {ErrorCode::kDeadlineExceeded, "the job ran too long",
          "at most " + std::to_string(std::lround(seconds_max)) + " s",
          std::to_string(std::lround(seconds)) + " s"};
}

}  // namespace

WorkerWatch::WorkerWatch(WatchLimits limits, Calls calls)
    : limits_(limits), calls_(std::move(calls)) {
  thread_ = std::thread([this] { run(); });
}

WorkerWatch::~WorkerWatch() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

void WorkerWatch::run() {
  while (true) {
    for (const WatchedWorker& worker : calls_.workers()) look(worker);
    const auto deadline = std::chrono::steady_clock::now() + kPeriod;
    MutexLock lock(mutex_);
    while (!ending_ && wake_.wait_until(lock, deadline) != std::cv_status::timeout) {
    }
    if (ending_) return;
  }
}

void WorkerWatch::look(const WatchedWorker& worker) const {
  const int64_t bytes = private_bytes(worker.pid);
  calls_.measured(worker, bytes);
  if (limits_.memory_bytes_max > 0 && bytes > limits_.memory_bytes_max) {
    calls_.condemned(worker, too_much_memory(bytes, limits_.memory_bytes_max));
  } else if (!worker.task.empty() && limits_.job_seconds_max > 0 &&
             worker.task_seconds > limits_.job_seconds_max) {
    calls_.condemned(worker, too_long(worker.task_seconds, limits_.job_seconds_max));
  }
}

}  // namespace voxeld
