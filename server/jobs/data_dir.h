// The directory of everything that a daemon keeps.
#pragma once

#include <filesystem>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

// Makes it, for its owner alone, and locks it as long as what comes back is open. Errors: conflict
// with another daemon as of lock_file(), internal, storage-full.
Result<UniqueFd> prepare_data_dir(const std::filesystem::path& dir);

}  // namespace voxeld
