// The HTTP API: a public listener and an admin listener (livez, readyz, metrics) on a port and
// thread of their own.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/api/access/origin_guard.h"
#include "server/http/http_server.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/auth/url_secret.h"
#include "server/jobs/service/job_service.h"
#include "server/store/held_files.h"

namespace voxeld::api {

struct ApiServerConfig {
  std::string listen = "127.0.0.1:8080";        // port 0: any; see port()
  std::string admin_listen = "127.0.0.1:8081";  // empty: no admin listener
  int64_t upload_bytes_max = limits::kUploadBytesMax;
  int request_threads = 64;
  // As of HttpServerConfig.
  int connections_max = 16384;
  int connections_per_address = 256;
  int admin_connections_max = 64;
  std::vector<std::string> trusted_proxies;
  HeldFiles* held_files = nullptr;  // outlives the server
  OriginRules origins;
  std::filesystem::path web_dir;  // the page's files instead of those embedded; empty: those
};

class ApiServer {
 public:
  virtual ~ApiServer() = default;
  virtual int port() const = 0;
  virtual int admin_port() const = 0;  // 0: there is none
  // Requests so far that were admitted. Counted before they are responded to.
  virtual uint64_t admitted_requests() const = 0;
  // Whether a request is read, runs, waits or is responded to.
  virtual bool is_busy() = 0;
  // Graceful: for at most `seconds`, running requests finish and new work is refused with
  // shutting-down; then closes. The admin listener goes on until then. Returns as
  // HttpServer::stop().
  virtual std::vector<http::RunningRequest> stop(double seconds) = 0;
};

// Binds both listeners and serves, the public one to holders of keys alone, on threads of its own.
// Errors: internal with the address and the system's words ("127.0.0.1:8080: Address already in
// use").
Result<std::unique_ptr<ApiServer>> start_api_server(
    const ApiServerConfig& config, JobService& jobs, const KeyRing& keys, const UrlSecrets& secrets,
    const std::shared_ptr<prometheus::Registry>& metrics);

}  // namespace voxeld::api
