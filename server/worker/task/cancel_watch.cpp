#include "server/worker/task/cancel_watch.h"

#include <ctime>

#include <algorithm>
#include <utility>

namespace voxeld {
namespace {

// Of all threads of this process.
double process_cpu_ms() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) * 1e3 + static_cast<double>(used.tv_nsec) / 1e6;
}

}  // namespace

CancelWatch::CancelWatch(const CancelScope& scope, std::function<std::string()> stage,
                         std::function<void()> tick)
    : scope_(scope),
      stage_(std::move(stage)),
      tick_(std::move(tick)),
      looked_at_(Clock::now()),
      cpu_ms_(process_cpu_ms()),
      thread_([this] { run(); }) {}

CancelWatch::~CancelWatch() {
  {
    const MutexLock lock(mutex_);
    ending_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

CancelWatch::Distance CancelWatch::longest() const {
  const MutexLock lock(mutex_);
  return longest_;
}

void CancelWatch::run() {
  MutexLock lock(mutex_);
  while (!ending_) {
    wake_.wait_for(lock, kPeriod);
    tick_();
    look();
  }
}

void CancelWatch::look() {
  const bool has_passed = scope_.has_passed_points();
  const auto now = Clock::now();
  const double cpu_ms = process_cpu_ms();
  const double passed_ms = std::chrono::duration<double, std::milli>(now - looked_at_).count();
  const double worked_ms = std::min(passed_ms, cpu_ms - cpu_ms_);
  since_point_ms_ = has_passed ? 0 : since_point_ms_ + worked_ms;
  looked_at_ = now;
  cpu_ms_ = cpu_ms;
  if (since_point_ms_ > longest_.ms) longest_ = {since_point_ms_, stage_()};
}

}  // namespace voxeld
