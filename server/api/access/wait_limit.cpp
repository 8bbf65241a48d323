#include "server/api/access/wait_limit.h"

namespace voxeld::api {

Result<std::unique_ptr<WaitLimit::Place>> WaitLimit::take(const std::string& tenant) {
  {
    const MutexLock lock(mutex_);
    const auto own = by_tenant_.find(tenant);
    const int used = own == by_tenant_.end() ? 0 : own->second;
    if (used >= places_ - taken_) {
      return Error{ErrorCode::kTooManyRequests,
                   "too many requests of this tenant " + std::string(what_) + " at a time",
                   "fewer than " + std::to_string(used + 1), "another"};
    }
    ++by_tenant_[tenant];
    ++taken_;
  }
  return std::make_unique<Place>(*this, tenant);
}

void WaitLimit::free(const std::string& tenant) {
  const MutexLock lock(mutex_);
  --taken_;
  const auto own = by_tenant_.find(tenant);
  if (--own->second == 0) by_tenant_.erase(own);
}

}  // namespace voxeld::api
