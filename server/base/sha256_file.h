// Hashes a file that need not fit into memory.
#pragma once

#include <filesystem>
#include <string>

#include "proto/result.h"

namespace voxeld {

// Returns "sha256-<64 hex>". Errors: those of MappedFile::open().
Result<std::string> sha256_file_id(const std::filesystem::path& path);

}  // namespace voxeld
