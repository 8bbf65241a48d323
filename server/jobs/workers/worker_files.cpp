#include "server/jobs/workers/worker_files.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr const char* kInput = "in";
constexpr const char* kOutput = "out";
constexpr const char* kCache = "cache";
constexpr const char* kTaken = "taken";

// Files that cannot be removed are removed with the connection's folder.
void empty_folder(const fs::path& folder) {
  const auto names = directory_names(folder);
  if (!names) return;
  for (const std::string& name : *names) {
    if (::unlink((folder / name).c_str()) != 0) remove_tree(folder / name);
  }
}

// A lease for reading is given when nobody has the file open for writing, mapped or not.
Status check_closed(int fd, const fs::path& file) {
  if (::fcntl(fd, F_SETLEASE, F_RDLCK) == 0) {
    ::fcntl(fd, F_SETLEASE, F_UNLCK);
    return {};
  }
  if (errno != EAGAIN) return {};  // a file system without leases
  return Error{ErrorCode::kInternal,
               "worker has its output " + file.filename().string() + " still open for writing", "",
               ""};
}

Status check_taken(const fs::path& file) {
  // O_NOFOLLOW, O_NONBLOCK: neither a link nor a pipe may lead the gateway astray.
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (!fd.valid()) return errno_error("open", file);
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error("stat", file);
  if (!S_ISREG(info.st_mode)) {
    return Error{ErrorCode::kInternal, file.filename().string() + " is not a regular file", "", ""};
  }
  if (info.st_nlink != 1) {
    return Error{ErrorCode::kInternal, file.filename().string() + " has other names", "1 link",
                 std::to_string(info.st_nlink)};
  }
  return check_closed(fd.get(), file);
}

constexpr int kLinkTriesMax = 1000;

// For a file system without links, or with too many of them.
Result<std::string> copied(const fs::path& blob, const fs::path& given) {
  std::error_code failed;
  fs::copy_file(blob, given, failed);
  if (!failed) return given.string();
  errno = failed.value();
  return errno_error("copy", blob);
}

}  // namespace

Status WorkerFiles::create() const {
  ::signal(SIGIO, SIG_IGN);  // comes when a lease of check_closed() is broken, and would kill
  for (const char* name : {kInput, kOutput, kCache, kTaken}) {
    std::error_code failed;
    fs::create_directories(root_ / name, failed);
    if (failed) {
      return Error{ErrorCode::kInternal, "create scratch directory: " + failed.message(), "", ""};
    }
  }
  return {};
}

WorkerFolders WorkerFiles::folders() const {
  return {(root_ / kOutput).string(), (root_ / kInput).string(), (root_ / kCache).string(), 0};
}

std::vector<fs::path> WorkerFiles::written() const {
  return {root_ / kOutput, root_ / kCache, root_ / kTaken};
}

Result<std::string> WorkerFiles::hand_over(const fs::path& blob) const {
  const fs::path given = root_ / kInput / blob.filename();
  // The store replaces a file when the same bytes come again. A link to the one that was found, and
  // has lost its name since, fails as one to a file that is not there.
  for (int tries = 0; ::link(blob.c_str(), given.c_str()) != 0 && errno != EEXIST; ++tries) {
    if (errno != ENOENT) return copied(blob, given);
    if (tries == kLinkTriesMax || ::access(blob.c_str(), F_OK) != 0) {
      return Error{ErrorCode::kNotFound, "the file " + blob.filename().string() + " is not stored",
                   "", ""};
    }
  }
  return given.string();
}

Result<fs::path> WorkerFiles::take(const std::string& output) const {
  const fs::path path(output);
  if (path.parent_path() != root_ / kOutput || path.filename() == "..") {
    return Error{ErrorCode::kInternal, "worker names an output outside its scratch directory",
                 (root_ / kOutput).string(), output};
  }
  fs::path taken = root_ / kTaken / path.filename();
  if (::rename(path.c_str(), taken.c_str()) != 0) return errno_error("take", path);
  VOXELD_TRY(check_taken(taken));
  return taken;
}

void WorkerFiles::clear() const {
  for (const char* name : {kInput, kOutput, kTaken}) empty_folder(root_ / name);
}

void WorkerFiles::remove() const noexcept {
  remove_tree(root_);
}

}  // namespace voxeld
