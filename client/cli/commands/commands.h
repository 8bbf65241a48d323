// The subcommands. Data goes to stdout or the output file, everything else to stderr.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Whether a server takes part; false for what reads local files alone.
bool needs_server(const Arguments& arguments);

// Whether a stop has something to cancel, to remove or to put back; else the command ignores it.
bool heeds_stop(const Arguments& arguments);

// `arguments` has the server's URL and key. Throws client::Error on failure.
void run_command(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
