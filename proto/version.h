// The version that daemon, client and CLI share: major.minor.patch, semantic versioning.
#pragma once

#include <string_view>

namespace voxeld {

std::string_view version();

}  // namespace voxeld
