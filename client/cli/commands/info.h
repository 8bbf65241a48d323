// The command info: what a mesh, a .voxg or a .voxs holds.
#pragma once

#include <stop_token>
#include <string>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Whether voxel reads the file itself, without a server.
bool is_container(const std::string& path);

// Throws client::Error.
void run_info(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
