// Checks the owner and mode of files and directories that the daemon trusts.
#pragma once

#include <filesystem>

#include <sys/stat.h>

#include "proto/result.h"

namespace voxeld {

// Checks that it belongs to this process's user or to root, and that no other user can write to it.
// Errors: conflict, with the command that repairs it.
Status check_trusted(const struct stat& info, const std::filesystem::path& path);
// The same for a secret, which no other user may read either. `owner`: a further user who may own
// it.
Status check_secret(const struct stat& info, const std::filesystem::path& path, uid_t owner);

}  // namespace voxeld
