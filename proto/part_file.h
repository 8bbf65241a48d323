// Files of both clients that appear only when they are complete.
#pragma once

#include <filesystem>

namespace voxeld {

// Creates a file beside `target` to be renamed to it, with its owner and its rights, as far as that
// is allowed, or those of a new file where there is none. `part`: its path. Returns a descriptor
// for writing; -1: none, errno tells why.
int create_part(const std::filesystem::path& target, std::filesystem::path& part);

}  // namespace voxeld
