// The subcommands. Data goes to stdout or the output file, everything else to stderr.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Throws client::Error on failure.
void run_command(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
