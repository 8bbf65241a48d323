// The server of the admin port: /livez, /readyz and /metrics. It shares no thread, event loop or
// parser with the public server, so that it tells of the daemon's health when that is wedged.
//
// cpp-httplib parses requests and writes responses, from memory to memory. It never sees a socket,
// since the versions that Debian ships hold a thread for each silent client and take heads without
// end (server/http/README.md lists what is known of them). Here heads are bounded in bytes and
// time, bodies are not read, and each connection has one request.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/api/http_types.h"

namespace voxeld::api {

// Requests of other paths and methods never come here. The head has method, path, authority and
// headers. The response's body is text.
using HealthHandler = std::function<Response(const Head& head)>;

struct HealthServerConfig {
  std::string listen = "127.0.0.1:8081";
  int connections_max = 64;  // the oldest one is closed for a new one
  // Paths that GET and HEAD may ask for.
  std::vector<std::string> paths;
};

inline constexpr size_t kHealthHeadBytesMax = 8192;
// From a connection's begin to its whole head, and from the response to its last byte.
inline constexpr std::chrono::seconds kHealthHeadTime{2}, kHealthSendTime{10};

class HealthServer {
 public:
  virtual ~HealthServer() = default;
  virtual int port() const = 0;
  // Closes all connections and ends the threads. Waits for handlers that run.
  virtual void stop() = 0;
};

// Errors: as http::listen_tcp().
Result<std::unique_ptr<HealthServer>> start_health_server(const HealthServerConfig& config,
                                                          HealthHandler handler);

}  // namespace voxeld::api
