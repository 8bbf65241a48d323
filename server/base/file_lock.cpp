#include "server/base/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>

namespace voxeld {
namespace {

// The pid that the holder wrote, for the message.
std::string holder_of(int fd) {
  std::array<char, 32> text{};
  const ssize_t count = ::pread(fd, text.data(), text.size() - 1, 0);
  std::string pid(text.data(), count > 0 ? static_cast<size_t>(count) : 0);
  while (!pid.empty() && pid.back() == '\n') pid.pop_back();
  return pid.empty() ? "another process" : "process " + pid;
}

Status lock(int fd, int number_fd, const std::filesystem::path& directory) {
  while (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) return errno_error("lock", directory);
    return Error{ErrorCode::kConflict, directory.string() + " is in use by " + holder_of(number_fd),
                 "one daemon for each data directory", ""};
  }
  return {};
}

Status write_number(int fd, const std::filesystem::path& path) {
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd, 0) != 0) return errno_error("write", path);
  if (::pwrite(fd, pid.data(), pid.size(), 0) < 0) return errno_error("write", path);
  return {};
}

}  // namespace

Result<UniqueFd> lock_file(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("open", path);
  VOXELD_TRY(lock(fd.get(), fd.get(), path.parent_path()));
  VOXELD_TRY(write_number(fd.get(), path));
  return fd;
}

Result<UniqueFd> lock_directory(const std::filesystem::path& directory) {
  UniqueFd fd(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd.valid()) return errno_error("open", directory);
  const std::filesystem::path path = directory / "lock";
  const UniqueFd number(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!number.valid()) return errno_error("open", path);
  VOXELD_TRY(lock(fd.get(), number.get(), directory));
  VOXELD_TRY(write_number(number.get(), path));
  return fd;
}

bool is_directory_locked(const std::filesystem::path& directory) {
  const UniqueFd fd(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return fd.valid() && ::flock(fd.get(), LOCK_SH | LOCK_NB) != 0;
}

}  // namespace voxeld
