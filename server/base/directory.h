// Directories, read and removed. Those of std::filesystem end the process where memory runs out:
// their iterators are noexcept and allocate.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// Names in a directory, without . and .., in no order. None where there is no such directory.
Result<std::vector<std::string>> directory_names(const std::filesystem::path& directory);
// Removes it with all that is in it, as far as that can be done.
void remove_tree(const std::filesystem::path& directory) noexcept;

}  // namespace voxeld
