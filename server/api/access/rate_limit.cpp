#include "server/api/access/rate_limit.h"

#include <algorithm>
#include <cmath>

namespace voxeld::api {
namespace {

constexpr double kBurstSeconds = 2;

int64_t whole_seconds(double seconds) {
  return static_cast<int64_t>(std::ceil(seconds));
}

}  // namespace

RateState RateLimiter::take(std::string_view tenant, int64_t per_minute, Clock::time_point now) {
  const double per_second = static_cast<double>(per_minute) / 60;
  const double burst = std::max(1.0, std::floor(per_second * kBurstSeconds));
  const MutexLock lock(mutex_);
  auto it = buckets_.find(tenant);
  if (it == buckets_.end()) it = buckets_.emplace(std::string(tenant), Bucket{burst, now}).first;
  Bucket& bucket = it->second;
  const double passed = std::chrono::duration<double>(now - bucket.at).count();
  bucket.left = std::min(burst, bucket.left + std::max(0.0, passed) * per_second);
  bucket.at = std::max(bucket.at, now);
  RateState state;
  state.admitted = bucket.left >= 1;
  if (state.admitted) bucket.left -= 1;
  state.burst = static_cast<int64_t>(burst);
  state.window_s = std::max<int64_t>(1, whole_seconds(burst / per_second));
  state.left = static_cast<int64_t>(bucket.left);
  state.reset_s = whole_seconds((burst - bucket.left) / per_second);
  state.retry_s =
      state.admitted ? 0 : std::max<int64_t>(1, whole_seconds((1 - bucket.left) / per_second));
  return state;
}

}  // namespace voxeld::api
