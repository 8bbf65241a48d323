// Counters of the HTTP side, and the access log.
#pragma once

#include <memory>
#include <string>

#include "server/http/front.h"

namespace prometheus {
class Registry;
}

namespace voxeld::http {

class RequestMetrics {
 public:
  // `registry` may be null: only the log is written then.
  explicit RequestMetrics(const std::shared_ptr<prometheus::Registry>& registry);
  ~RequestMetrics();
  // Thread-safe. `route` is the pattern, not the path, so that labels stay few.
  void record(const ExchangeRecord& exchange, const std::string& route);
  void set_state(const FrontState& state, int subscribers);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::http
