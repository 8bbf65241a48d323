#include "server/api/process_metrics.h"

#include <prometheus/gauge.h>
#include <prometheus/registry.h>
#include <sys/resource.h>
#include <time.h>

#include "server/base/disk/directory.h"
#include "server/process/machine.h"

namespace voxeld::api {
namespace {

// Entries of a folder of /proc; -1 where it cannot be read.
double entries(const char* folder) {
  const auto names = directory_names(folder);
  return names ? static_cast<double>(names->size()) : -1;
}

double cpu_seconds() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) / 1e9;
}

double descriptors_max() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 ? static_cast<double>(limit.rlim_cur) : -1;
}

double unix_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) / 1e9;
}

prometheus::Gauge& gauge(prometheus::Registry& registry, const char* name, const char* help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add({});
}

void set(prometheus::Gauge& gauge, double value) {
  if (value >= 0) gauge.Set(value);
}

}  // namespace

struct ProcessMetrics::Gauges {
  explicit Gauges(prometheus::Registry& registry)
      : resident(gauge(registry, "process_resident_memory_bytes", "Resident memory in bytes")),
        descriptors(gauge(registry, "process_open_fds", "Open file descriptors")),
        descriptors_limit(gauge(registry, "process_max_fds", "Limit on open file descriptors")),
        threads(gauge(registry, "process_threads", "Threads")),
        cpu(gauge(registry, "process_cpu_seconds_total", "User and system CPU time in seconds")),
        start(gauge(registry, "process_start_time_seconds", "Start, in seconds of Unix time")) {}

  prometheus::Gauge &resident, &descriptors, &descriptors_limit, &threads, &cpu, &start;
};

ProcessMetrics::ProcessMetrics(const std::shared_ptr<prometheus::Registry>& registry) {
  if (!registry) return;
  gauges_ = std::make_shared<Gauges>(*registry);
  gauges_->start.Set(unix_seconds());
}

void ProcessMetrics::refresh() {
  if (!gauges_) return;
  if (const int64_t bytes = resident_bytes(); bytes > 0) {
    gauges_->resident.Set(static_cast<double>(bytes));
  }
  // The folder itself is open while it is read.
  set(gauges_->descriptors, entries("/proc/self/fd") - 1);
  set(gauges_->descriptors_limit, descriptors_max());
  set(gauges_->threads, entries("/proc/self/task"));
  gauges_->cpu.Set(cpu_seconds());
}

}  // namespace voxeld::api
