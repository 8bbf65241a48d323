// What each subcommand does. Data goes to stdout or the output file, everything else to stderr.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Throws client::Error; returns normally when all went well.
void run_command(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
