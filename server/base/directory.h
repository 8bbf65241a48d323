// Reads and removes directories. The iterators of std::filesystem are noexcept but allocate, so
// they end the process when memory runs out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

// Names in a directory, without . and .., in no order. Empty if the directory does not exist.
Result<std::vector<std::string>> directory_names(const std::filesystem::path& directory);
// Removes the directory with all its contents, as far as possible.
void remove_tree(const std::filesystem::path& directory) noexcept;

}  // namespace voxeld
