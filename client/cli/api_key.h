// The API key that requests carry.
#pragma once

#include <string>
#include <string_view>

namespace voxeld::cli {

// `flag` where it is not empty, else $VOXELD_KEY, else what the file $VOXELD_KEY_FILE holds, else
// none. Throws client::Error "file" for one that cannot be read.
std::string api_key(const std::string& flag);

// What is printed: keys that stand in it (a flag was misspelled, say) end after "vxk_".
std::string without_keys(std::string_view text);

}  // namespace voxeld::cli
