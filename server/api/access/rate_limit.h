// How often a tenant may ask.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "server/api/http_types.h"
#include "server/base/thread_annotations.h"

namespace voxeld::api {

// One token bucket per tenant: requests come back steadily, those of two seconds may come at once.
// Thread-safe. Buckets stay: there are no more tenants than names in the key file.
class RateLimiter {
 public:
  using Clock = std::chrono::steady_clock;
  // Takes one request of `per_minute` (1 or more), where there is one left.
  RateState take(std::string_view tenant, int64_t per_minute, Clock::time_point now)
      EXCLUDES(mutex_);

 private:
  struct Bucket {
    double left = 0;
    Clock::time_point at;
  };
  Mutex mutex_;
  std::map<std::string, Bucket, std::less<>> buckets_ GUARDED_BY(mutex_);
};

}  // namespace voxeld::api
