// The server that a command talks to.
#pragma once

#include <stop_token>
#include <string>

#include "client/cli/arguments.h"

namespace voxeld::cli {

struct Server {
  std::string url, key;
};

inline constexpr const char* kDefaultUrl = "http://127.0.0.1:8080";

// In this order: --url, $VOXELD_URL, `url` of the configuration file, a voxeld at kDefaultUrl, the
// user's private daemon (which is started, with a line on a terminal, unless --no-local). --local
// chooses the private daemon.
//
// Throws client::Error: those of api_key(), read_config_file() and use_private_daemon().
Server find_server(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
