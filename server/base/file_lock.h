// A lock on a file or a directory that lasts until the process ends, however it ends.
#pragma once

#include <filesystem>

#include "proto/result.h"
#include "server/base/file.h"

namespace voxeld {

// Creates the file, locks it (flock) and writes this process's pid into it. The lock lasts as long
// as the descriptor. Errors: conflict with the other process's pid if it is taken.
Result<UniqueFd> lock_file(const std::filesystem::path& path);
// Locks a directory. Removing a file in it cannot circumvent this lock. DIR/lock holds the pid.
Result<UniqueFd> lock_directory(const std::filesystem::path& directory);
// Whether some process holds lock_directory().
bool is_directory_locked(const std::filesystem::path& directory);

}  // namespace voxeld
