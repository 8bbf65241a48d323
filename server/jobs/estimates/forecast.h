// When jobs will start and end: the queue played through, with tenants sharing the devices as the
// scheduler lets them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace voxeld {

struct ForecastJob {
  std::string tenant;
  double weight = 1;   // of the tenant
  double seconds = 0;  // that are left of it
  bool is_started = false;
};

// Seconds from now.
struct ForecastTimes {
  double start = 0, end = 0;
};

// `jobs` in the order in which each tenant's own are taken. Tenants with jobs share `devices`
// devices by their weights, each at most one device at a time; of a tenant one job runs at a time,
// first what has started. This is the fluid limit of fair queueing (Parekh & Gallager 1993), which
// start-time fair queueing follows to within a tile of each tenant. O(n t) for n jobs of t tenants.
std::vector<ForecastTimes> forecast(const std::vector<ForecastJob>& jobs, int devices);

}  // namespace voxeld
