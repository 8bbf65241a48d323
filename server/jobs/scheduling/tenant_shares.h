// The device time of tenants while they had jobs. It decides which tenant gets a worker next, and
// which gives one up.
//
// Time slices (time_slices.h) divide the device among tenants that have a worker. If there are more
// tenants than workers, these shares assign the workers, over minutes. A share is the seconds of
// the device divided by the tenant's weight, counted while the tenant has jobs. A new tenant starts
// at the lowest share of the active ones, so an absent tenant saves up no time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>

namespace voxeld {

// The shares of one device. Not thread-safe.
class TenantShares {
 public:
  // Caps a tenant's accumulated lead, in seconds of the device. The excess, which jobs that cannot
  // be preempted may cause, is forgiven.
  static constexpr double kAheadSecondsMax = 10;

  // The tenants that have jobs now, queued or started. Between two calls nobody comes or goes.
  void set_wanting(std::set<std::string, std::less<>> tenants);
  void charge(const std::string& tenant, double seconds, int64_t weight);
  double of(const std::string& tenant) const;

 private:
  double level_ = 0;  // the least of those that were there
  std::set<std::string, std::less<>> wanting_;
  std::map<std::string, double, std::less<>> had_;
};

}  // namespace voxeld
