// How much of a device tenants have had while they wanted it: who gets a worker next, and who gives
// one up.
//
// Time slices (time_slices.h) divide the device among those that have a worker. Where there are
// more tenants than workers, these shares say who is to have one, over minutes: seconds of the
// device over the tenant's weight, counted as long as the tenant has jobs. Who comes anew begins
// with the least that others have who are there, so that nobody saves up time by being away.
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
  // Seconds of the device by which a tenant can be ahead: of more, as those had who were there with
  // jobs that cannot be preempted, it need not pay back.
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
