// A lock on a file that holds until the process ends, however it ends.
#pragma once

#include <filesystem>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

// Creates the file, locks it (flock) and writes the process's number into it. Keep the descriptor
// as long as the lock should hold. Errors: conflict with the other process's number when it is
// taken.
Result<UniqueFd> lock_file(const std::filesystem::path& path);

}  // namespace voxeld
