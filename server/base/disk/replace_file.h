// Replacement of a small file as a whole.
#pragma once

#include <filesystem>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// Writes a file and syncs it. Readers see the old text or the new one, also after power loss. Makes
// the folder. An error leaves no other file. Errors: as write_file().
Status replace_file(const std::filesystem::path& path, std::string_view text);

}  // namespace voxeld
