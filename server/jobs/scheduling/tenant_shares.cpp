#include "server/jobs/scheduling/tenant_shares.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace voxeld {

void TenantShares::set_wanting(std::set<std::string, std::less<>> tenants) {
  std::optional<double> least;
  for (const std::string& tenant : tenants) {
    if (wanting_.contains(tenant)) least = std::min(least.value_or(of(tenant)), of(tenant));
  }
  level_ = std::max(level_, least.value_or(level_));
  for (const std::string& tenant : tenants) {
    if (!wanting_.contains(tenant)) had_[tenant] = of(tenant);
  }
  wanting_ = std::move(tenants);
  std::erase_if(had_, [this](const auto& entry) {
    return entry.second <= level_ && !wanting_.contains(entry.first);
  });
}

void TenantShares::charge(const std::string& tenant, double seconds, int64_t weight) {
  const double ahead_max = level_ + kAheadSecondsMax / static_cast<double>(weight);
  const double before = of(tenant);
  const double after = before + seconds / static_cast<double>(weight);
  had_[tenant] = std::max(before, std::min(after, ahead_max));
}

double TenantShares::of(const std::string& tenant) const {
  const auto found = had_.find(tenant);
  return found == had_.end() ? level_ : std::max(level_, found->second);
}

}  // namespace voxeld
