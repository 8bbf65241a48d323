// Checks who may change a file or directory that the daemon trusts.
#pragma once

#include <filesystem>

#include <sys/stat.h>

#include "proto/result.h"

namespace voxeld {

// That it belongs to this process's user or to root, and that nobody else can write to it. Errors:
// conflict, with the command that mends it.
Status check_trusted(const struct stat& info, const std::filesystem::path& path);
// The same for a secret, which nobody else can read either. `owner`: another user whose it may be.
Status check_secret(const struct stat& info, const std::filesystem::path& path, uid_t owner);

}  // namespace voxeld
