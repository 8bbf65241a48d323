// Holds workers to what they may write, as WorkerWatch does to memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/store/disk_room.h"

namespace voxeld {

struct WatchedScratch {
  int64_t pid = 0;
  std::string task;                            // job id
  std::vector<std::filesystem::path> folders;  // that the worker writes to
};

// That what a task wrote to these folders is within its limit. `bytes_max` 0: no limit. Errors:
// storage-full, also for what cannot be measured: only a hostile worker writes that.
Status check_scratch(const std::vector<std::filesystem::path>& folders, int64_t bytes_max);

class ScratchWatch {
 public:
  static constexpr std::chrono::milliseconds kPeriod{250};
  // If the disk is nearly full, a worker that has written less than this is not to blame.
  static constexpr int64_t kBlamedBytesMin = int64_t{1} << 20;

  // Called on the watch's thread.
  struct Calls {
    std::function<std::vector<WatchedScratch>()> workers;  // that run a task
    // The worker has to go, and its job ends with this.
    std::function<void(const WatchedScratch&, const Error&)> condemned;
  };
  ScratchWatch(int64_t bytes_max, DiskRoom& disk, Calls calls);
  ~ScratchWatch();
  ScratchWatch(const ScratchWatch&) = delete;
  ScratchWatch& operator=(const ScratchWatch&) = delete;

 private:
  void run();
  void look() const;

  const int64_t bytes_max_;
  DiskRoom& disk_;
  const Calls calls_;
  Mutex mutex_;
  CondVar wake_;
  bool ending_ GUARDED_BY(mutex_) = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace voxeld
