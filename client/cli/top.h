// `voxel top`: the daemon's devices and queue, again every second.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// One look, as text or JSON, where that is asked for or stdout is no terminal; else until q, Ctrl-C
// or SIGTERM. Throws client::Error; a daemon that goes away while it is watched is waited for.
void watch_queue(const Arguments& arguments, client::Client& daemon, const std::stop_token& stop);

}  // namespace voxeld::cli
