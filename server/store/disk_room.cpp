#include "server/store/disk_room.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <string>

#include "server/base/disk/file.h"
#include "server/base/log.h"

namespace voxeld {

namespace {

// Sizes of the ballast that are free before it is allocated: with one less, the next write would
// free it at once.
constexpr int64_t kFreeBallasts = 2;

}  // namespace

Result<int64_t> DiskRoom::free_bytes() const {
  struct statvfs info {};
  if (::statvfs(data_dir_.c_str(), &info) != 0) {
    return errno_error("read free space of", data_dir_);
  }
  return static_cast<int64_t>(info.f_bavail) * static_cast<int64_t>(info.f_frsize);
}

Result<int64_t> DiskRoom::total_bytes() const {
  struct statvfs info {};
  if (::statvfs(data_dir_.c_str(), &info) != 0) return errno_error("read size of", data_dir_);
  return static_cast<int64_t>(info.f_blocks) * static_cast<int64_t>(info.f_frsize);
}

Result<int64_t> DiskRoom::reserve_bytes() const {
  if (reserve_bytes_max_ == 0) return int64_t{0};
  VOXELD_ASSIGN(const int64_t total, total_bytes());
  return std::min(reserve_bytes_max_, total / kReservePartOfDisk);
}

Result<int64_t> DiskRoom::record_bytes_max() const {
  VOXELD_ASSIGN(const int64_t total, total_bytes());
  return std::min(kRecordBytesMax, total / kRecordPartOfDisk);
}

Result<int64_t> DiskRoom::ballast_bytes() const {
  VOXELD_ASSIGN(const int64_t total, total_bytes());
  return std::min(kBallastBytesMax, total / kBallastPartOfDisk);
}

Status DiskRoom::check(int64_t bytes_min, const char* refused) const {
  if (bytes_min == 0) return {};
  VOXELD_ASSIGN(const int64_t free, free_bytes());
  if (free >= bytes_min) return {};
  return Error{ErrorCode::kStorageFull,
               "the disk is nearly full; " + std::string(refused) + " refused, delete something",
               "at least " + std::to_string(bytes_min) + " bytes free", std::to_string(free)};
}

Status DiskRoom::check_with_ballast(int64_t bytes_min, const char* refused) {
  bool is_freed = false;
  {
    const MutexLock lock(mutex_);
    is_freed = was_freed_;
  }
  if (!is_freed) return check(bytes_min, refused);
  keep_ballast();
  const MutexLock lock(mutex_);
  if (!was_freed_) return check(bytes_min, refused);
  VOXELD_ASSIGN(const int64_t ballast, ballast_bytes());
  return check(std::max(bytes_min, kFreeBallasts * ballast), refused);
}

Status DiskRoom::for_data() {
  VOXELD_ASSIGN(const int64_t reserve, reserve_bytes());
  return check_with_ballast(reserve, "uploads and results are");
}

Status DiskRoom::for_jobs() {
  VOXELD_ASSIGN(const int64_t reserve, reserve_bytes());
  return check_with_ballast(reserve == 0 ? 0 : reserve + kJobRoomBytes, "jobs are");
}

Result<DiskRoom::Room> DiskRoom::take(int64_t bytes) {
  VOXELD_TRY(for_data());
  VOXELD_ASSIGN(const int64_t reserve, reserve_bytes());
  const MutexLock lock(mutex_);
  if (reserve > 0) VOXELD_TRY(check(reserve + taken_ + bytes, "uploads and results are"));
  taken_ += bytes;
  return Room(*this, bytes);
}

void DiskRoom::give_back(int64_t bytes) {
  const MutexLock lock(mutex_);
  taken_ -= bytes;
}

Result<int64_t> DiskRoom::worker_reserve_bytes() const {
  VOXELD_ASSIGN(const int64_t reserve, reserve_bytes());
  return reserve == 0 ? 0 : reserve + kRowRoomBytes;
}

bool DiskRoom::is_nearly_full() const {
  const auto reserve = reserve_bytes();
  return reserve && !check(*reserve / 2, "");
}

bool DiskRoom::make_way() {
  const auto free = free_bytes(), ballast = ballast_bytes();
  if (!free || !ballast || *free >= *ballast) return false;
  const MutexLock lock(mutex_);
  if (::unlink(ballast_path().c_str()) == 0) {
    was_freed_ = true;
    log::warn("the disk is full: the ballast is freed for deletes", {{"bytes", *ballast}});
  }
  return true;
}

void DiskRoom::keep_ballast() {
  const auto free = free_bytes(), ballast = ballast_bytes();
  if (!free || !ballast) return;
  const MutexLock lock(mutex_);
  struct stat info {};
  if (::stat(ballast_path().c_str(), &info) == 0) {
    was_freed_ = false;
    return;
  }
  was_freed_ = true;
  if (*free < kFreeBallasts * *ballast) return;  // these bytes stay free for deletes instead
  const UniqueFd fd(::open(ballast_path().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (fd.valid() && ::posix_fallocate(fd.get(), 0, *ballast) == 0) {
    was_freed_ = false;
  } else {
    ::unlink(ballast_path().c_str());
  }
}

}  // namespace voxeld
