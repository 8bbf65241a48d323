// Listening sockets.
#pragma once

#include <optional>
#include <string>

#include "proto/result.h"
#include "server/base/disk/file.h"

namespace voxeld::http {

inline constexpr int kBacklog = 1024;

// "127.0.0.1:8080". SO_REUSEADDR alone: with SO_REUSEPORT a second daemon would take half of the
// connections. Errors: invalid-option, internal with the system's words.
Result<UniqueFd> listen_tcp(const std::string& address);
int port_of(int fd);

struct Accepted {
  UniqueFd fd;  // invalid: none waits, or there is no descriptor left for it (errno says)
  std::string address;
  bool is_loopback = false;
};
// Without waiting; small writes go out at once.
Accepted accept_one(int listener);

}  // namespace voxeld::http
