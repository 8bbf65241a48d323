#include "server/http/memory_budget.h"

#include <algorithm>
#include <utility>

namespace voxeld::http {

MemoryShare::MemoryShare(MemoryBudget& budget, std::string tenant, void* owner)
    : budget_(budget), tenant_(std::move(tenant)), owner_(owner) {}

MemoryShare::~MemoryShare() {
  const MutexLock lock(budget_.mutex_);
  const auto it = budget_.accounts_.find(tenant_);
  if (it == budget_.accounts_.end()) return;
  if (is_waiting_) {
    std::erase(it->second.waiting, this);
    --budget_.waiting_count_;
  }
  budget_.take(it->second, *this, 0);
}

bool MemoryShare::reserve(int64_t bytes) {
  const MutexLock lock(budget_.mutex_);
  if (wanted_ > 0) {  // it has waited
    if (is_waiting_) return false;
    wanted_ = 0;
    return true;
  }
  MemoryBudget::Account& account = budget_.accounts_[tenant_];
  account.bytes -= bytes_;
  budget_.bytes_ -= bytes_;
  bytes_ = 0;
  if (account.waiting.empty() && budget_.has_room(account, bytes)) {
    budget_.take(account, *this, bytes);
    return true;
  }
  account.waiting.push_back(this);
  wanted_ = bytes;
  is_waiting_ = true;
  ++budget_.waiting_count_;
  return false;
}

void MemoryShare::set(int64_t bytes) {
  const MutexLock lock(budget_.mutex_);
  if (bytes == bytes_) return;
  budget_.take(budget_.accounts_[tenant_], *this, bytes);
}

int64_t MemoryBudget::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

bool MemoryBudget::has_room(const Account& account, int64_t bytes) const {
  if (account.bytes == 0) return true;
  return account.bytes + bytes <= limits_.tenant_bytes_max && bytes_ + bytes <= limits_.bytes_max;
}

void MemoryBudget::take(Account& account, MemoryShare& share, int64_t bytes) {
  account.bytes += bytes - share.bytes_;
  bytes_ += bytes - share.bytes_;
  share.bytes_ = bytes;
  if (account.bytes == 0 && account.waiting.empty()) accounts_.erase(share.tenant_);
}

std::vector<void*> MemoryBudget::grant() {
  std::vector<void*> owners;
  const MutexLock lock(mutex_);
  for (auto& [tenant, account] : accounts_) {
    while (!account.waiting.empty() && has_room(account, account.waiting.front()->wanted_)) {
      MemoryShare& share = *account.waiting.front();
      account.waiting.pop_front();
      share.is_waiting_ = false;
      --waiting_count_;
      take(account, share, share.wanted_);
      owners.push_back(share.owner_);
    }
  }
  return owners;
}

}  // namespace voxeld::http
