#include "server/jobs/estimates/forecast.h"

#include <algorithm>
#include <cstddef>
#include <deque>
#include <limits>
#include <map>
#include <utility>

namespace voxeld {
namespace {

// One tenant's jobs, those that are left.
struct Lane {
  double weight = 1;
  std::deque<size_t> jobs;
  double left = 0;  // of the first one
  double rate = 0;  // devices that it has
};

// Rates in proportion to the weights, none above one device; what that leaves goes to the others.
void share(std::map<std::string, Lane>& lanes, double devices) {
  std::vector<Lane*> open;
  open.reserve(lanes.size());
  for (auto& [tenant, lane] : lanes) open.push_back(&lane);
  while (!open.empty()) {
    double weights = 0;
    for (const Lane* lane : open) weights += lane->weight;
    const auto is_full = [&](const Lane* lane) { return devices * lane->weight / weights >= 1.0; };
    const auto full =
        std::partition(open.begin(), open.end(), [&](const Lane* lane) { return !is_full(lane); });
    if (full == open.end()) {
      for (Lane* lane : open) lane->rate = devices * lane->weight / weights;
      return;
    }
    for (auto it = full; it != open.end(); ++it) (*it)->rate = 1.0;
    devices = std::max(0.0, devices - static_cast<double>(open.end() - full));
    open.erase(full, open.end());
  }
}

}  // namespace

std::vector<ForecastTimes> forecast(const std::vector<ForecastJob>& jobs, int devices) {
  std::vector<ForecastTimes> times(jobs.size());
  std::map<std::string, Lane> lanes;
  for (const bool started : {true, false}) {
    for (size_t i = 0; i < jobs.size(); ++i) {
      if (jobs[i].is_started != started) continue;
      Lane& lane = lanes[jobs[i].tenant];
      lane.weight = std::max(jobs[i].weight, 1e-6);
      lane.jobs.push_back(i);
    }
  }
  for (auto& [tenant, lane] : lanes) lane.left = jobs[lane.jobs.front()].seconds;
  double now = 0;
  while (!lanes.empty()) {
    share(lanes, std::max(devices, 1));
    double step = std::numeric_limits<double>::infinity();
    for (const auto& [tenant, lane] : lanes) step = std::min(step, lane.left / lane.rate);
    now += std::max(step, 0.0);
    for (auto it = lanes.begin(); it != lanes.end();) {
      Lane& lane = it->second;
      lane.left -= step * lane.rate;
      const auto next = std::next(it);
      if (lane.left <= 1e-9) {
        times[lane.jobs.front()].end = now;
        lane.jobs.pop_front();
        if (lane.jobs.empty()) {
          lanes.erase(it);
        } else {
          times[lane.jobs.front()].start = now;
          lane.left = jobs[lane.jobs.front()].seconds;
        }
      }
      it = next;
    }
  }
  return times;
}

}  // namespace voxeld
