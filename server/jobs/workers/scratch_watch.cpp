#include "server/jobs/workers/scratch_watch.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "server/base/disk/directory.h"
#include "server/base/guard.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

Result<int64_t> bytes_of(const std::vector<fs::path>& folders) {
  int64_t total = 0;
  for (const fs::path& folder : folders) {
    VOXELD_ASSIGN(const int64_t bytes, tree_bytes(folder));
    total += bytes;
  }
  return total;
}

}  // namespace

Status check_scratch(const std::vector<fs::path>& folders, int64_t bytes_max) {
  if (bytes_max == 0) return {};
  const Result<int64_t> bytes = bytes_of(folders);
  if (!bytes) {
    return Error{ErrorCode::kStorageFull,
                 "what the job writes cannot be measured: " + bytes.error().message(), "", ""};
  }
  if (*bytes <= bytes_max) return {};
  return Error{ErrorCode::kStorageFull, "the job writes more than one worker may",
               "at most " + std::to_string(bytes_max) + " bytes", std::to_string(*bytes)};
}

ScratchWatch::ScratchWatch(int64_t bytes_max, DiskRoom& disk, Calls calls)
    : bytes_max_(bytes_max), disk_(disk), calls_(std::move(calls)) {
  thread_ = std::thread([this] { run(); });
}

ScratchWatch::~ScratchWatch() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

void ScratchWatch::run() {
  while (true) {
    guarded("the watch of what workers write", [this] { look(); });
    const auto deadline = std::chrono::steady_clock::now() + kPeriod;
    MutexLock lock(mutex_);
    while (!ending_ && wake_.wait_until(lock, deadline) != std::cv_status::timeout) {
    }
    if (ending_) return;
  }
}

// Ends at most one worker at a time for a full disk: the room that it frees may be enough.
void ScratchWatch::look() const {
  std::vector<WatchedScratch> workers = calls_.workers();
  std::erase_if(workers, [this](const WatchedScratch& worker) {
    const Status within = check_scratch(worker.folders, bytes_max_);
    if (!within) calls_.condemned(worker, within.error());
    return !within.ok();
  });
  if (workers.empty() || !disk_.is_nearly_full()) return;
  // A worker whose folders cannot be measured counts as the largest.
  const auto bytes_of_worker = [](const WatchedScratch& worker) {
    const Result<int64_t> bytes = bytes_of(worker.folders);
    return bytes ? *bytes : std::numeric_limits<int64_t>::max();
  };
  const auto first = std::ranges::max_element(workers, {}, bytes_of_worker);
  if (bytes_of_worker(*first) < kBlamedBytesMin) return;
  const Status full = disk_.for_data();
  if (!full) calls_.condemned(*first, full.error());
}

}  // namespace voxeld
