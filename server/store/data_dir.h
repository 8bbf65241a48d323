// The directory of everything that a daemon keeps.
#pragma once

#include <filesystem>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld {

// That nobody but this process's user and root can put files there: whoever can makes keys of their
// own. One that is missing is fine. Errors: conflict as of check_trusted().
Status check_data_dir(const std::filesystem::path& dir);

// Makes it, for its owner alone, checks and locks it as long as what comes back is open. Errors:
// conflict with another daemon as of lock_directory(), or as of check_data_dir(); internal,
// storage-full.
Result<UniqueFd> prepare_data_dir(const std::filesystem::path& dir);

}  // namespace voxeld
