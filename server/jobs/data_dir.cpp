#include "server/jobs/data_dir.h"

#include <system_error>

#include "server/base/file_lock.h"

namespace voxeld {

namespace fs = std::filesystem;

Result<UniqueFd> prepare_data_dir(const fs::path& dir) {
  std::error_code failed;
  const bool made = fs::create_directories(dir, failed);
  if (!failed && made) {
    fs::permissions(dir, fs::perms::owner_all, failed);
    VOXELD_TRY(sync_path(fs::absolute(dir).lexically_normal().parent_path()));
  }
  if (!failed) fs::create_directories(dir / "run", failed);
  if (failed) return code_error("cannot create the data directory", dir, failed);
  return lock_file(dir / "lock");
}

}  // namespace voxeld
