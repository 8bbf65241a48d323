#include "server/store/blob_checks.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <span>
#include <utility>

#include "server/base/disk/file.h"
#include "server/base/log.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

// Remembered results, some 20 MB. When there are more, all are dropped and read again.
constexpr size_t kRememberedMax = 100'000;
constexpr size_t kReadBytes = size_t{1} << 16;

FileStamp stamp_from(const struct stat& info) {
  constexpr int64_t kNsPerSecond = 1'000'000'000;
  return {info.st_dev, info.st_ino, static_cast<int64_t>(info.st_size),
          static_cast<int64_t>(info.st_mtim.tv_sec) * kNsPerSecond + info.st_mtim.tv_nsec};
}

Error no_file(const std::filesystem::path& path) {
  if (errno == ENOENT) {
    return {ErrorCode::kNotFound, "no such blob", "a stored blob", path.filename().string()};
  }
  return errno_error("open", path);
}

// Returns the stamp, and whether the bytes under it are those of `id`.
Result<std::pair<FileStamp, bool>> read_blob(const std::string& id,
                                             const std::filesystem::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return no_file(path);
  struct stat info {};
  // The stamp is taken before reading: a write in between changes it, and the file is read again.
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", path);
  VOXELD_ASSIGN(const auto hashed, hash_file(fd.get(), path));
  return std::pair(stamp_from(info), hashed.first == id);
}

}  // namespace

Result<FileStamp> stamp_of(const std::filesystem::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return no_file(path);
  return stamp_from(info);
}

Result<std::pair<std::string, int64_t>> hash_file(int fd, const std::filesystem::path& path) {
  ::posix_fadvise(fd, 0, 0, POSIX_FADV_SEQUENTIAL);
  Sha256 hash;
  int64_t total = 0;
  // A larger one would be new pages from the kernel for each small file.
  std::array<uint8_t, kReadBytes> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  while (true) {
    const ssize_t count = ::read(fd, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error("read", path);
    if (count == 0) break;
    hash.update(std::span(buffer.data(), static_cast<size_t>(count)));
    total += count;
  }
  return std::pair(hash.finish_id(), total);
}

std::optional<bool> BlobChecks::known(const std::string& id, const FileStamp& stamp) {
  const MutexLock lock(mutex_);
  const auto found = found_.find(id);
  if (found == found_.end() || found->second.stamp != stamp) return std::nullopt;
  return found->second.is_intact;
}

void BlobChecks::note(const std::string& id, const Found& found) {
  const MutexLock lock(mutex_);
  if (found_.size() >= kRememberedMax) found_.clear();
  found_.insert_or_assign(id, found);
  if (!found.is_intact) ++damaged_;
}

void BlobChecks::note_intact(const std::string& id, const std::filesystem::path& path) {
  if (const auto stamp = stamp_of(path)) note(id, {*stamp, true});
}

int64_t BlobChecks::damaged_count() const {
  const MutexLock lock(mutex_);
  return damaged_;
}

Result<BlobChecks::Found> BlobChecks::check(const std::string& id,
                                            const std::filesystem::path& path) {
  VOXELD_ASSIGN(const FileStamp before, stamp_of(path));
  if (const auto answer = known(id, before)) return Found{before, *answer};
  {
    MutexLock lock(mutex_);
    while (reading_.contains(id)) changed_.wait(lock);
    reading_.insert(id);
  }
  // Ends on every path out of this function.
  struct Reading {
    BlobChecks& checks;
    const std::string& id;
    ~Reading() {
      const MutexLock lock(checks.mutex_);
      checks.reading_.erase(checks.reading_.find(id));
      checks.changed_.notify_all();
    }
  } const reading{*this, id};
  VOXELD_ASSIGN(const FileStamp stamp, stamp_of(path));
  if (const auto answer = known(id, stamp)) return Found{stamp, *answer};
  VOXELD_ASSIGN(const auto read, read_blob(id, path));
  const Found found{read.first, read.second};
  note(id, found);
  if (!found.is_intact) {
    log::error("a blob is damaged: its bytes are not those that it is named after",
               {{"blob", id}, {"bytes", found.stamp.bytes}});
  }
  return found;
}

}  // namespace voxeld
