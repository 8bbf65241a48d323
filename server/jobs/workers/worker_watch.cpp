#include "server/jobs/workers/worker_watch.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "server/base/guard.h"
#include "server/process/machine.h"

namespace voxeld {
namespace {

// The next attempt would take as much, so the job ends at once.
Error too_much_memory(int64_t bytes, int64_t bytes_max) {
  const std::string taken = memory_text(bytes), limit = memory_text(bytes_max);
  return {ErrorCode::kGridTooLarge, "memory: " + taken + ", limit " + limit,
          "work that a worker can do within " + limit, taken};
}

Error too_long(double seconds, double seconds_max) {
  char expected[48], got[32];
  std::snprintf(expected, sizeof expected, "at most %g s", seconds_max);
  std::snprintf(got, sizeof got, "%.1f s", seconds);
  return {ErrorCode::kDeadlineExceeded, "the job ran too long", expected, got};
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
    guarded("the watch of workers", [this] { look_at_workers(); });
    const auto deadline = std::chrono::steady_clock::now() + kPeriod;
    MutexLock lock(mutex_);
    while (!ending_ && wake_.wait_until(lock, deadline) != std::cv_status::timeout) {
    }
    if (ending_) return;
  }
}

void WorkerWatch::look_at_workers() const {
  const std::vector<WatchedWorker> workers = calls_.workers();
  std::vector<Measured> remaining;
  for (const WatchedWorker& worker : workers) {
    const Measured measured{&worker, private_bytes(worker.pid)};
    if (look(measured)) remaining.push_back(measured);
  }
  look_at_all(remaining);
}

bool WorkerWatch::look(const Measured& measured) const {
  const auto& [worker, bytes] = measured;
  calls_.measured(*worker, bytes);
  if (limits_.memory_bytes_max > 0 && bytes > limits_.memory_bytes_max) {
    calls_.condemned(*worker, too_much_memory(bytes, limits_.memory_bytes_max));
    return false;
  }
  if (!worker->task.empty() && limits_.job_seconds_max > 0 &&
      worker->task_seconds > limits_.job_seconds_max) {
    calls_.condemned(*worker, too_long(worker->task_seconds, limits_.job_seconds_max));
    return false;
  }
  if (!worker->task.empty() && limits_.silent_seconds_max > 0 &&
      worker->silent_seconds > limits_.silent_seconds_max) {
    calls_.silent(*worker);
  }
  return true;
}

// A task asks for memory once its mesh is read; several large ones that are read at the same time
// have not asked yet. One goes at a time: what it leaves may do for the others.
void WorkerWatch::look_at_all(const std::vector<Measured>& all) const {
  if (limits_.all_memory_bytes_max <= 0) return;
  int64_t sum = 0;
  for (const Measured& one : all) sum += one.bytes;
  if (sum <= limits_.all_memory_bytes_max) return;
  const auto beyond = [](const Measured& one) { return one.bytes - one.worker->asked_bytes; };
  const auto first = std::max_element(
      all.begin(), all.end(), [&](const auto& a, const auto& b) { return beyond(a) < beyond(b); });
  const auto busy =
      std::ranges::count_if(all, [](const Measured& one) { return !one.worker->task.empty(); });
  const WatchedWorker& worker = *first->worker;
  const bool counts = busy <= 1 || first->bytes > limits_.all_memory_bytes_max ||
                      (worker.was_displaced && worker.asked_bytes > 0);
  calls_.displaced(worker, {"memory of all workers: " + memory_text(sum) + ", limit " +
                                memory_text(limits_.all_memory_bytes_max) + "; this one took " +
                                memory_text(first->bytes) + " and had asked for " +
                                memory_text(worker.asked_bytes),
                            counts, std::max(first->bytes, worker.needed_bytes)});
}

}  // namespace voxeld
