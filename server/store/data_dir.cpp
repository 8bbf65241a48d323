#include "server/store/data_dir.h"

#include <sys/stat.h>

#include <cerrno>
#include <system_error>

#include "server/base/disk/directory.h"

namespace voxeld {

namespace fs = std::filesystem;

Status check_data_dir(const fs::path& dir) {
  struct stat info {};
  if (::stat(dir.c_str(), &info) == 0) return check_trusted(info, dir);
  return errno == ENOENT ? Status() : errno_error("stat", dir);
}

Result<UniqueFd> prepare_data_dir(const fs::path& dir) {
  VOXELD_TRY(check_data_dir(dir));
  std::error_code failed;
  const bool made = fs::create_directories(dir, failed);
  if (!failed && made) {
    fs::permissions(dir, fs::perms::owner_all, failed);
    VOXELD_TRY(sync_path(fs::absolute(dir).lexically_normal().parent_path()));
  }
  if (!failed) fs::create_directories(dir / "run", failed);
  if (failed) return code_error("cannot create the data directory", dir, failed);
  return lock_directory(dir);
}

}  // namespace voxeld
