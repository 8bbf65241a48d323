#include "server/api/access/upload_bytes.h"

namespace voxeld::api {

Status UploadBytes::Share::add(int64_t bytes) {
  VOXELD_TRY(all_.take(tenant_, bytes, bytes_max_));
  bytes_ += bytes;
  return {};
}

Status UploadBytes::take(const std::string& tenant, int64_t bytes, int64_t bytes_max) {
  const MutexLock lock(mutex_);
  const auto own = by_tenant_.find(tenant);
  const int64_t sum = bytes + (own == by_tenant_.end() ? 0 : own->second);
  if (bytes_max > 0 && sum > bytes_max) {
    return Error{ErrorCode::kTooManyRequests,
                 "uploads of this tenant that have not ended hold its whole quota",
                 "at most " + std::to_string(bytes_max) + " bytes of them", std::to_string(sum)};
  }
  if (bytes > 0) by_tenant_[tenant] = sum;
  return {};
}

void UploadBytes::give_back(const std::string& tenant, int64_t bytes) {
  const MutexLock lock(mutex_);
  const auto own = by_tenant_.find(tenant);
  if (own == by_tenant_.end()) return;
  own->second -= bytes;
  if (own->second == 0) by_tenant_.erase(own);
}

}  // namespace voxeld::api
