// `voxel top`: the daemon's devices and queue, refreshed every second.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Prints one snapshot, as text or JSON, if requested or if stdout is not a terminal. Otherwise runs
// until q, Ctrl-C or SIGTERM. If the daemon goes away meanwhile, it waits for it. Throws
// client::Error.
void watch_queue(const Arguments& arguments, client::Client& daemon, const std::stop_token& stop);

}  // namespace voxeld::cli
