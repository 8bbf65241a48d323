// SIGTERM and SIGINT: the first begins an orderly end, which may take only so long; a second one
// ends the process at once.
#pragma once

#include <chrono>
#include <thread>

#include "server/base/disk/file.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// After --drain-seconds, what still runs is cut, and workers and database are closed. The process
// exits this long after the drain at the latest, whatever has not come to its end: what was
// acknowledged is on the disk by then (server/jobs/README.md, Durability).
inline constexpr double kCloseSecondsMax = 1.5;
// Time to log what did not end; a log that nobody reads must not hold the process either.
inline constexpr double kLastWordsSecondsMax = 0.25;

// Make it before any other thread: those that are started later have the signals blocked, and its
// own thread takes them. Thread-safe.
class ShutdownWatch {
 public:
  explicit ShutdownWatch(double drain_seconds);
  // The end came in time.
  ~ShutdownWatch();
  ShutdownWatch(const ShutdownWatch&) = delete;
  ShutdownWatch& operator=(const ShutdownWatch&) = delete;

  // The first signal, or 0 after `seconds`.
  int wait(double seconds) EXCLUDES(mutex_);
  // The stage of shutdown that begins now, for the log; a literal.
  void enter(const char* stage) EXCLUDES(mutex_);

 private:
  void run();
  bool is_over_within(double seconds);
  void end_process();

  const double drain_seconds_;
  UniqueFd signals_;    // signalfd
  const UniqueFd end_;  // eventfd: readable once the watch is over
  Mutex mutex_;
  CondVar changed_;
  int signal_ GUARDED_BY(mutex_) = 0;
  const char* stage_ GUARDED_BY(mutex_) = "start";
  std::thread thread_;
};

}  // namespace voxeld
