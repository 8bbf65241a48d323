// Finds the API key that requests carry, and hides keys in output.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace voxeld::cli {

// `flag` if it is not empty, else $VOXELD_KEY, else the content of the file $VOXELD_KEY_FILE, else
// that of `configured`, else "". Throws client::Error "file" if the file cannot be read.
std::string api_key(const std::string& flag, const std::filesystem::path& configured = {});

// The text for printing. Keys in it (of a misspelled flag, say) are cut after "vxk_".
std::string without_keys(std::string_view text);

}  // namespace voxeld::cli
