// Metrics of the daemon's own process, under the names that Prometheus' clients use.
#pragma once

#include <memory>

namespace prometheus {
class Gauge;
class Registry;
}  // namespace prometheus

namespace voxeld::api {

// process_resident_memory_bytes, process_open_fds, process_max_fds, process_threads,
// process_cpu_seconds_total and process_start_time_seconds, as of the last refresh().
class ProcessMetrics {
 public:
  // `registry` may be null: nothing is done then.
  explicit ProcessMetrics(const std::shared_ptr<prometheus::Registry>& registry);
  // Reads /proc; what cannot be read stays as it was.
  void refresh();

 private:
  struct Gauges;
  std::shared_ptr<Gauges> gauges_;
};

}  // namespace voxeld::api
