#include "server/jobs/retention/age_budget.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace voxeld {

Result<int64_t> AgeBudget::left(int64_t kept_now_ms,
                                const std::function<Result<int64_t>()>& count) {
  if (kept_now_ms >= window_end_ms_) {
    VOXELD_ASSIGN(const int64_t there, count());
    constexpr double kWindowsPerDay = 24.0 * 60 * 60 * 1000 / kWindowMs;
    const double share = std::max(kShare, kAverages / (keep_days_ * kWindowsPerDay));
    left_ = static_cast<int64_t>(std::ceil(static_cast<double>(there) * std::min(1.0, share)));
    // Blobs that were stored and expired within the window were not counted.
    if (share >= 1.0) left_ = std::numeric_limits<int64_t>::max();
    window_end_ms_ = kept_now_ms + kWindowMs;
    was_told_ = false;
  }
  return left_;
}

bool AgeBudget::take_exhausted() {
  if (left_ > 0 || was_told_) return false;
  was_told_ = true;
  return true;
}

}  // namespace voxeld
