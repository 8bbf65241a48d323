#include "server/jobs/workers/scratch_watch.h"

#include <sys/stat.h>

#include <algorithm>
#include <utility>

#include "server/base/directory.h"
#include "server/base/guard.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kStatBlockBytes = 512;  // unit of st_blocks, whatever the file system's is

// Bytes of the folder's files, and of those of its folders down to `depth`.
int64_t bytes_in(const fs::path& folder, int depth) {
  int64_t bytes = 0;
  const auto names = directory_names(folder);
  if (!names) return 0;  // it went
  for (const std::string& name : *names) {
    struct stat info {};
    if (::lstat((folder / name).c_str(), &info) != 0) continue;
    bytes += static_cast<int64_t>(info.st_blocks) * kStatBlockBytes;
    if (S_ISDIR(info.st_mode) && depth > 0) bytes += bytes_in(folder / name, depth - 1);
  }
  return bytes;
}

int64_t bytes_of(const std::vector<fs::path>& folders) {
  int64_t bytes = 0;
  for (const fs::path& folder : folders) bytes += folder_bytes(folder);
  return bytes;
}

int64_t bytes_of_worker(const WatchedScratch& worker) {
  return bytes_of(worker.folders);
}

}  // namespace

int64_t folder_bytes(const fs::path& folder) {
  constexpr int kDepthMax = 8;  // caches of drivers have two or three levels
  return bytes_in(folder, kDepthMax);
}

Status check_scratch(const std::vector<fs::path>& folders, int64_t bytes_max) {
  if (bytes_max == 0) return {};
  const int64_t bytes = bytes_of(folders);
  if (bytes <= bytes_max) return {};
  return Error{ErrorCode::kStorageFull, "the job writes more than one worker may",
               "at most " + std::to_string(bytes_max) + " bytes", std::to_string(bytes)};
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

// One goes at a time for the disk: what it leaves may do for the others.
void ScratchWatch::look() const {
  std::vector<WatchedScratch> workers = calls_.workers();
  std::erase_if(workers, [this](const WatchedScratch& worker) {
    const Status within = check_scratch(worker.folders, bytes_max_);
    if (!within) calls_.condemned(worker, within.error());
    return !within.ok();
  });
  if (workers.empty() || !disk_.is_nearly_full()) return;
  const auto first = std::ranges::max_element(workers, {}, bytes_of_worker);
  if (bytes_of_worker(*first) < kBlamedBytesMin) return;
  const Status full = disk_.for_data();
  if (!full) calls_.condemned(*first, full.error());
}

}  // namespace voxeld
