#include "server/jobs/auth/private_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

#include "server/base/disk/directory.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kFileBytesMax = int64_t{16} << 20;  // some 100,000 keys

Status check_file(int fd, const fs::path& file) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) return errno_error("stat", file);
  if (!S_ISREG(info.st_mode)) {
    return Error{ErrorCode::kInternal, file.string() + " is not a regular file", "", ""};
  }
  // An administrator's command may read what belongs to the daemon's user (give_to_owner()).
  struct stat directory {};
  if (::stat(file.parent_path().c_str(), &directory) != 0) return errno_error("stat", file);
  VOXELD_TRY(check_secret(info, file, ::geteuid() == 0 ? directory.st_uid : 0));
  if (info.st_size > kFileBytesMax) {
    return Error{ErrorCode::kInternal, file.string(),
                 "at most " + std::to_string(kFileBytesMax) + " bytes",
                 std::to_string(info.st_size)};
  }
  return {};
}

Result<std::string> read_text(int fd, const fs::path& file) {
  std::string text;
  std::array<char, 65536> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  while (true) {
    const ssize_t count = ::read(fd, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error("read", file);
    if (count == 0) return text;
    text.append(buffer.data(), static_cast<size_t>(count));
  }
}

// An administrator may make keys for a daemon that runs as somebody else, who must be able to read
// them: the directory tells who that is.
Status give_to_owner(int fd, const fs::path& file) {
  struct stat directory {};
  if (::stat(file.parent_path().c_str(), &directory) != 0) return errno_error("stat", file);
  if (::geteuid() != 0 || directory.st_uid == 0) return {};
  if (::fchown(fd, directory.st_uid, directory.st_gid) == 0) return {};
  return errno_error("change the owner of", file);
}

Status make_dir(const fs::path& dir) {
  std::error_code failed;
  const bool made = fs::create_directories(dir, failed);
  if (!failed && made) fs::permissions(dir, fs::perms::owner_all, failed);
  if (!failed) return {};
  return Error{ErrorCode::kInternal,
               "cannot create the data directory " + dir.string() + ": " + failed.message(), "",
               ""};
}

}  // namespace

FileMark mark_of(const fs::path& file) {
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0) return {};
  return {true, info.st_ino, info.st_size, info.st_ctim.tv_sec, info.st_ctim.tv_nsec};
}

Result<std::optional<std::string>> read_private(const fs::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd.valid() && errno == ENOENT) return std::optional<std::string>();
  if (!fd.valid() && errno == ENOTDIR) {
    return Error{ErrorCode::kInvalidOption, "the data directory", "a directory",
                 file.parent_path().string()};
  }
  if (!fd.valid()) return errno_error("open", file);
  VOXELD_TRY(check_file(fd.get(), file));
  VOXELD_ASSIGN(std::string text, read_text(fd.get(), file));
  return std::optional(std::move(text));
}

Status replace_private(const fs::path& file, const std::string& text) {
  fs::path temporary = file;
  temporary += ".new";
  ::unlink(temporary.c_str());  // of a process that was killed; O_EXCL: its mode is the one below
  const UniqueFd fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", temporary);
  VOXELD_TRY(write_all(fd.get(), {reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  VOXELD_TRY(give_to_owner(fd.get(), temporary));
  if (::fsync(fd.get()) != 0) return errno_error("sync", temporary);
  if (::rename(temporary.c_str(), file.c_str()) != 0) return errno_error("replace", file);
  return sync_path(file.parent_path());
}

Result<UniqueFd> lock_private(const fs::path& file) {
  VOXELD_TRY(make_dir(file.parent_path()));
  const fs::path path = file.string() + ".lock";
  constexpr int kTries = 100;
  for (int tries = 1;; ++tries) {
    auto lock = lock_file(path);
    if (lock) VOXELD_TRY(give_to_owner(lock->get(), path));
    if (lock || lock.error().code != ErrorCode::kConflict) return lock;
    if (tries == kTries) {
      return Error{ErrorCode::kConflict,
                   "another process changes the " + file.filename().string() + "; try again", "",
                   ""};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace voxeld
