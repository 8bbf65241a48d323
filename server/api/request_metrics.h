// Metrics of HTTP requests, and the access log.
#pragma once

#include <memory>
#include <string>

#include "server/http/http_server.h"

namespace prometheus {
class Registry;
}

namespace voxeld::api {

class RequestMetrics {
 public:
  // `registry` may be null: only the log is written then.
  explicit RequestMetrics(const std::shared_ptr<prometheus::Registry>& registry);
  ~RequestMetrics();
  // Thread-safe. `route` is the pattern, not the path, so that labels stay few.
  void record(const http::ExchangeRecord& exchange, const std::string& route);
  void set_state(const http::HttpServerState& state, int event_streams);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::api
