#include "server/base/disk/directory.h"

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
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "server/base/disk/file.h"

namespace voxeld {
namespace {

// Measures of a tree whose directories are moved meanwhile. A worker at work renames files only.
constexpr int kMeasuresMax = 8;

struct Closer {
  void operator()(DIR* directory) const { ::closedir(directory); }
};
using OpenDirectory = std::unique_ptr<DIR, Closer>;

bool is_entry(std::string_view name) {
  return name != "." && name != "..";
}

OpenDirectory open_at(int parent, const char* name) {
  const int fd = ::openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return nullptr;
  OpenDirectory directory(::fdopendir(fd));
  if (directory == nullptr) ::close(fd);
  return directory;
}

// Follows no link: the descriptor is that of a directory. O_PATH needs no permission for it.
void make_accessible(int parent, const char* name) {
  const UniqueFd fd(::openat(parent, name, O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!fd.valid()) return;
  std::array<char, 32> path{};
  std::snprintf(path.data(), path.size(), "/proc/self/fd/%d", fd.get());
  [[maybe_unused]] const int changed = ::chmod(path.data(), S_IRWXU);
}

// Opens a directory of this user for reading and changing, also where its mode forbids both: a
// hostile worker can hide files by that.
OpenDirectory enter(int parent, const char* name) {
  OpenDirectory directory = open_at(parent, name);
  if (directory == nullptr && errno == EACCES) {
    make_accessible(parent, name);
    directory = open_at(parent, name);
  }
  if (directory == nullptr) return nullptr;
  struct stat info {};
  const int fd = ::dirfd(directory.get());
  if (::fstat(fd, &info) == 0 && (info.st_mode & S_IRWXU) != S_IRWXU) ::fchmod(fd, S_IRWXU);
  return directory;
}

// Removes what is in a directory. Inner directories move up into it, one after the other, and are
// emptied there: three descriptors are enough for every depth, and nothing is allocated for names.
class TreeRemoval {
 public:
  explicit TreeRemoval(DIR* root) : root_(root), root_fd_(::dirfd(root)) {}

  void run() {
    while (const dirent* entry = ::readdir(root_)) {
      if (!is_entry(entry->d_name)) continue;
      remove(entry->d_name);
      while (removed_ < moved_) remove(moved_name(removed_++).data());
    }
  }

 private:
  using Name = std::array<char, 32>;

  static Name moved_name(uint64_t number) {
    Name name{};
    std::snprintf(name.data(), name.size(), "removed-%ju", static_cast<uintmax_t>(number));
    return name;
  }

  // An entry of the root.
  void remove(const char* name) {
    if (::unlinkat(root_fd_, name, 0) == 0) return;
    const OpenDirectory directory = enter(root_fd_, name);
    if (directory == nullptr) return;
    const int fd = ::dirfd(directory.get());
    while (const dirent* entry = ::readdir(directory.get())) {
      const char* inner = entry->d_name;
      if (!is_entry(inner) || ::unlinkat(fd, inner, 0) == 0) continue;
      if (::unlinkat(fd, inner, AT_REMOVEDIR) != 0) move_up(fd, inner);
    }
    ::unlinkat(root_fd_, name, AT_REMOVEDIR);
  }

  // A name may be taken by what is in the root already.
  void move_up(int parent, const char* name) {
    // A directory that changes its parent must be writable itself.
    if (enter(parent, name) == nullptr) return;
    while (::renameat(parent, name, root_fd_, moved_name(moved_++).data()) != 0) {
      if (errno != ENOTEMPTY && errno != EEXIST && errno != ENOTDIR) return;
    }
  }

  DIR* const root_;
  const int root_fd_;
  uint64_t moved_ = 0;    // numbers of names that are given
  uint64_t removed_ = 0;  // of them, those that are done
};

// One walk over a tree, in depth first. It holds two descriptors: it goes up by "..", which is the
// directory that it came from unless that was moved.
class TreeMeasure {
 public:
  explicit TreeMeasure(const std::filesystem::path& root) : root_(root) {}

  // Nothing: a directory was moved meanwhile.
  Result<std::optional<int64_t>> run() {
    OpenDirectory current = enter(AT_FDCWD, root_.c_str());
    if (current == nullptr && errno == ENOENT) return std::optional<int64_t>(0);
    if (current == nullptr) return errno_error("list", root_);
    VOXELD_TRY(read(current.get()));
    while (true) {
      if (levels_.back().folders.empty()) {
        levels_.pop_back();
        if (levels_.empty()) return std::optional<int64_t>(bytes_);
        current = open_at(::dirfd(current.get()), "..");
        if (current == nullptr) return errno_error("list a folder in", root_);
        if (!is_last_level(current.get())) return std::optional<int64_t>();
        continue;
      }
      const std::string name = std::move(levels_.back().folders.back());
      levels_.back().folders.pop_back();
      OpenDirectory inner = enter(::dirfd(current.get()), name.c_str());
      if (inner == nullptr && errno != ENOENT && errno != ENOTDIR && errno != ELOOP) {
        return errno_error("list a folder in", root_);
      }
      if (inner == nullptr) continue;  // it was removed or replaced
      current = std::move(inner);
      VOXELD_TRY(read(current.get()));
    }
  }

 private:
  struct Level {
    dev_t device = 0;
    ino_t inode = 0;
    std::vector<std::string> folders;  // that are not measured yet
  };

  bool is_last_level(DIR* directory) const {
    struct stat info {};
    return ::fstat(::dirfd(directory), &info) == 0 && info.st_dev == levels_.back().device &&
           info.st_ino == levels_.back().inode;
  }

  // Counts the entries of a directory and makes it the last level.
  Status read(DIR* directory) {
    const int fd = ::dirfd(directory);
    struct stat info {};
    if (::fstat(fd, &info) != 0) return errno_error("stat a folder in", root_);
    Level level{info.st_dev, info.st_ino, {}};
    while (const dirent* entry = ::readdir(directory)) {
      if (!is_entry(entry->d_name)) continue;
      if (++entries_ > kTreeEntriesMax) {
        return Error{ErrorCode::kInternal, "too many files in " + root_.string(),
                     "at most " + std::to_string(kTreeEntriesMax), "more"};
      }
      if (::fstatat(fd, entry->d_name, &info, AT_SYMLINK_NOFOLLOW) != 0) continue;  // it went
      bytes_ += disk_bytes(info);
      if (S_ISDIR(info.st_mode)) level.folders.emplace_back(entry->d_name);
    }
    levels_.push_back(std::move(level));
    return {};
  }

  const std::filesystem::path& root_;
  std::vector<Level> levels_;  // the directories above the current one, and that one
  int64_t bytes_ = 0, entries_ = 0;
};

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
  // A process that has just been killed may still create files.
  constexpr int kTries = 6;
  constexpr std::chrono::milliseconds kFirstPause{10};
  for (int tries = 0; tries < kTries; ++tries) {
    if (tries > 0) std::this_thread::sleep_for(kFirstPause * (1 << tries));
    {
      const OpenDirectory directory = enter(AT_FDCWD, path.c_str());
      if (directory == nullptr) return;
      TreeRemoval(directory.get()).run();
    }
    if (::rmdir(path.c_str()) == 0 || (errno != ENOTEMPTY && errno != EEXIST)) return;
  }
}

Result<int64_t> tree_bytes(const std::filesystem::path& path) {
  for (int measures = 0; measures < kMeasuresMax; ++measures) {
    VOXELD_ASSIGN(const std::optional<int64_t> bytes, TreeMeasure(path).run());
    if (bytes) return *bytes;
  }
  return Error{ErrorCode::kInternal,
               "folders are moved while they are measured in " + path.string(), "", ""};
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
