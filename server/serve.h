// `voxeld serve`: gateway and workers in one.
#pragma once

#include <string>

#include "server/config.h"

namespace voxeld {

// Runs until SIGTERM or SIGINT. `self_executable` is started again for each worker. Prints one line
// to stdout when the first worker is connected: "ready http://HOST:PORT admin=http://HOST:PORT
// device=NAMES". Returns the exit status.
int serve_main(const ServeConfig& config, const std::string& self_executable);

}  // namespace voxeld
