// Names of tenants as labels of metrics.
#pragma once

#include <cstddef>
#include <set>
#include <string>

#include "server/base/thread_annotations.h"

namespace voxeld {

// Tenants with a label of their own; the others share one. Those of a year may be many, and each is
// a time series for ever.
inline constexpr size_t kTenantLabelsMax = 200;

// Thread-safe.
class TenantLabels {
 public:
  std::string of(const std::string& tenant) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (!tenants_.contains(tenant) && tenants_.size() >= kTenantLabelsMax) return "(other)";
    tenants_.insert(tenant);
    return tenant;
  }

 private:
  Mutex mutex_;
  std::set<std::string> tenants_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
