#include "server/base/disk/disk_reserve.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <string>

#include "server/base/disk/file.h"

namespace voxeld {
namespace {

std::atomic<int64_t> reserve_bytes{0};
std::atomic<FreeBytes> measure{free_bytes_at};

Status check(int fd, int64_t more_bytes) {
  const int64_t free = measure.load()(fd), reserve = reserve_bytes;
  if (free < 0 || free - more_bytes >= reserve) return {};
  return Error{
      ErrorCode::kStorageFull, "the disk is nearly full; outputs are refused, delete something",
      "at least " + std::to_string(reserve) + " bytes free beside " + std::to_string(more_bytes),
      std::to_string(free)};
}

// Gives back what is allocated behind the end of the file.
void shorten(int fd) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) return;
  [[maybe_unused]] const int done = ::ftruncate(fd, info.st_size);
}

}  // namespace

int64_t free_bytes_at(int fd) {
  struct statvfs info {};
  if (::fstatvfs(fd, &info) != 0 || info.f_blocks == 0) return -1;
  return static_cast<int64_t>(info.f_bavail) * static_cast<int64_t>(info.f_frsize);
}

void keep_disk_reserve(int64_t bytes, FreeBytes free_bytes) {
  measure = free_bytes;
  reserve_bytes = bytes;
}

Status reserve_room(int fd, int64_t offset, int64_t bytes) {
  if (reserve_bytes == 0) return {};
  VOXELD_TRY(check(fd, bytes));
  if (bytes < kAllocatedBytesMin) return {};
  if (::fallocate(fd, FALLOC_FL_KEEP_SIZE, offset, bytes) != 0) {
    const bool is_full = errno == ENOSPC || errno == EDQUOT;
    return is_full ? errno_error("write", "file") : Status();  // else it cannot be allocated ahead
  }
  // Others may have allocated since the first check.
  Status left = check(fd, 0);
  if (!left) shorten(fd);
  return left;
}

}  // namespace voxeld
