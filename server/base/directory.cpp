#include "server/base/directory.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "server/base/file.h"

namespace voxeld {

namespace {

// Limits the recursion. A worker's files are one level deep, so a deeper tree is an attack.
constexpr int kDepthMax = 32;

struct Closer {
  void operator()(DIR* directory) const { ::closedir(directory); }
};
using OpenDirectory = std::unique_ptr<DIR, Closer>;

bool is_entry(std::string_view name) {
  return name != "." && name != "..";
}

// Takes ownership of the descriptor.
void remove_content(int fd, int depth) noexcept {
  const OpenDirectory directory(::fdopendir(fd));
  if (directory == nullptr) {
    ::close(fd);
    return;
  }
  while (const dirent* entry = ::readdir(directory.get())) {
    const char* name = entry->d_name;
    if (!is_entry(name) || ::unlinkat(fd, name, 0) == 0 || depth == kDepthMax) continue;
    const int inner = ::openat(fd, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (inner < 0) continue;
    remove_content(inner, depth + 1);
    ::unlinkat(fd, name, AT_REMOVEDIR);
  }
}

}  // namespace

Status make_directory(const std::filesystem::path& path) {
  if (::mkdir(path.c_str(), 0700) == 0) return sync_path(path.parent_path());
  return errno == EEXIST ? Status() : errno_error("create directory", path);
}

Result<std::vector<std::string>> directory_names(const std::filesystem::path& path) {
  const OpenDirectory directory(::opendir(path.c_str()));
  std::vector<std::string> names;
  if (directory == nullptr && errno == ENOENT) return names;
  if (directory == nullptr) return errno_error("list", path);
  errno = 0;
  while (const dirent* entry = ::readdir(directory.get())) {
    if (is_entry(entry->d_name)) names.emplace_back(entry->d_name);
    errno = 0;
  }
  if (errno != 0) return errno_error("list", path);
  return names;
}

void remove_tree(const std::filesystem::path& path) noexcept {
  const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return;
  remove_content(fd, 0);
  ::rmdir(path.c_str());
}

namespace {

// The pid that the holder wrote, for the message.
std::string holder_of(int fd) {
  std::array<char, 32> text{};
  const ssize_t count = ::pread(fd, text.data(), text.size() - 1, 0);
  std::string pid(text.data(), count > 0 ? static_cast<size_t>(count) : 0);
  while (!pid.empty() && pid.back() == '\n') pid.pop_back();
  return pid.empty() ? "another process" : "process " + pid;
}

// Whether the process that wrote its number has ended.
bool has_holder_ended(int fd) {
  std::array<char, 32> text{};
  const ssize_t count = ::pread(fd, text.data(), text.size() - 1, 0);
  const auto pid = static_cast<pid_t>(count > 0 ? std::strtol(text.data(), nullptr, 10) : 0);
  return pid > 0 && ::kill(pid, 0) != 0 && errno == ESRCH;
}

Status lock(int fd, int number_fd, const std::filesystem::path& directory) {
  // A process that is killed while it starts a child leaves the lock to that child, until it is a
  // program of its own.
  constexpr std::chrono::milliseconds kChildWait{5000}, kPoll{10};
  const auto until = std::chrono::steady_clock::now() + kChildWait;
  while (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) return errno_error("lock", directory);
    if (has_holder_ended(number_fd) && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(kPoll);
      continue;
    }
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

namespace {

std::string mode_text(mode_t mode) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "mode %04o", static_cast<unsigned>(mode & 07777));
  return text.data();
}

Status check_owner(const struct stat& info, const std::filesystem::path& path, uid_t owner) {
  const uid_t self = ::geteuid();
  if (info.st_uid == self || info.st_uid == 0 || info.st_uid == owner) return {};
  const std::string uid = std::to_string(self);
  return Error{ErrorCode::kConflict,
               path.string() + " belongs to another user; look who made it, then run chown " + uid +
                   " " + path.string(),
               self == 0 ? "uid 0" : "uid " + uid + " or 0", "uid " + std::to_string(info.st_uid)};
}

Status check_mode(const struct stat& info, const std::filesystem::path& path, mode_t refused,
                  const char* expected, const char* change) {
  if ((info.st_mode & refused) == 0) return {};
  return Error{ErrorCode::kConflict,
               path.string() +
                   " is open to other users; look what they made of it, then run chmod " + change +
                   " " + path.string(),
               expected, mode_text(info.st_mode)};
}

}  // namespace

Status check_trusted(const struct stat& info, const std::filesystem::path& path) {
  VOXELD_TRY(check_owner(info, path, ::geteuid()));
  return check_mode(info, path, S_IWGRP | S_IWOTH, "no write permission for group and others",
                    "go-w");
}

Status check_secret(const struct stat& info, const std::filesystem::path& path, uid_t owner) {
  VOXELD_TRY(check_owner(info, path, owner));
  return check_mode(info, path, S_IRWXG | S_IRWXO, "no permission for group and others", "go-rwx");
}

}  // namespace voxeld
