// A lock on a file or a directory that holds until the process ends, however it ends.
#pragma once

#include <filesystem>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

// Creates the file, locks it (flock) and writes the process's number into it. Keep the descriptor
// as long as the lock should hold. Errors: conflict with the other process's number when it is
// taken.
Result<UniqueFd> lock_file(const std::filesystem::path& path);
// The same for a directory, which no file in it can be removed to get around. DIR/lock tells the
// process's number.
Result<UniqueFd> lock_directory(const std::filesystem::path& directory);
// Whether some process holds lock_directory().
bool is_directory_locked(const std::filesystem::path& directory);

}  // namespace voxeld
