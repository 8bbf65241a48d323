#include "server/jobs/auth/key_ring.h"

#include <algorithm>
#include <utility>

#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/sha256.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {

Result<std::unique_ptr<KeyRing>> KeyRing::open(const std::filesystem::path& data_dir,
                                               std::chrono::milliseconds check_interval) {
  std::unique_ptr<KeyRing> ring(new KeyRing(key_file_path(data_dir), check_interval));
  {
    const MutexLock lock(ring->mutex_);
    ring->seen_ = mark_of(ring->file_);
    VOXELD_TRY(ring->load(/*was_open=*/true));
  }
  return ring;
}

std::optional<KeyRing::Holder> KeyRing::admit(std::string_view presented) const {
  if (auto holder = holder_among(*current(), presented)) return holder;
  return holder_among(*current(Look::kNow), presented);
}

std::optional<KeyRing::Holder> KeyRing::holder_among(const Keys& keys, std::string_view presented) {
  if (keys.is_open) return Holder{Caller::open(), ""};
  static const ApiKey nobody{"", "", sha256_id("nobody"), 0, 0, 0, 1, false, {}};
  const PresentedKey key = split_key(presented);
  const ApiKey* known = keys.find(key.id);
  const ApiKey& candidate = known != nullptr ? *known : nobody;
  const bool is_same = equal_in_constant_time(candidate.secret_hash, sha256_id(key.secret));
  const bool is_live = candidate.is_live(unix_time_ms());
  if (known == nullptr || !is_same || !is_live) return std::nullopt;
  return Holder{Caller::tenant(candidate.tenant, candidate.is_admin), candidate.id};
}

bool KeyRing::is_live(std::string_view key_id) const {
  const std::shared_ptr<const Keys> keys = current();
  if (keys->is_open || key_id.empty()) return keys->is_open;
  const ApiKey* key = keys->find(key_id);
  return key != nullptr && key->is_live(unix_time_ms());
}

int64_t KeyRing::weight_of(std::string_view tenant) const {
  const std::shared_ptr<const Keys> keys = current();
  const auto own = keys->by_tenant.find(tenant);
  if (own == keys->by_tenant.end()) return 1;
  const ApiKey* key = newest_key(own->second, tenant, unix_time_ms());
  return key == nullptr ? 1 : key->weight;
}

std::optional<KeyRing::Holder> KeyRing::holder_of(std::string_view key_id) const {
  const std::shared_ptr<const Keys> keys = current();
  if (keys->is_open && key_id.empty()) return Holder{Caller::open(), ""};
  const ApiKey* key = keys->find(key_id);
  if (key == nullptr || !key->is_live(unix_time_ms())) return std::nullopt;
  return Holder{Caller::tenant(key->tenant, key->is_admin), key->id};
}

TenantLimits KeyRing::limits_of(std::string_view tenant) const {
  const std::shared_ptr<const Keys> keys = current();
  const auto own = keys->by_tenant.find(tenant);
  if (own == keys->by_tenant.end()) return {};
  const ApiKey* key = newest_key(own->second, tenant, unix_time_ms());
  if (key == nullptr) key = newest_key(own->second, tenant);
  return key->limits;
}

bool KeyRing::has_several_tenants() const {
  const std::shared_ptr<const Keys> keys = current();
  const int64_t now_ms = unix_time_ms();
  int tenants = 0;
  for (const auto& [tenant, own] : keys->by_tenant) {
    if (newest_key(own, tenant, now_ms) != nullptr && ++tenants > 1) return true;
  }
  return false;
}

uint64_t KeyRing::epoch() const {
  const std::shared_ptr<const Keys> keys = current();
  const int64_t now_ms = unix_time_ms();
  const auto live =
      std::ranges::count_if(keys->list, [&](const ApiKey& key) { return key.is_live(now_ms); });
  const MutexLock lock(mutex_);
  return (uint64_t{loads_} << 32) + static_cast<uint64_t>(live);
}

Status KeyRing::status() const {
  current();
  const MutexLock lock(mutex_);
  return status_;
}

const ApiKey* KeyRing::Keys::find(std::string_view id) const {
  const auto it = by_id.find(id);
  return it == by_id.end() ? nullptr : it->second;
}

std::shared_ptr<const KeyRing::Keys> KeyRing::current(Look look) const {
  const MutexLock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (look == Look::kWhenDue && now < check_at_) return keys_;
  check_at_ = now + check_interval_;
  // Before the file is read: what changes after this is seen by the next call.
  const FileMark mark = mark_of(file_);
  if (mark == seen_) return keys_;
  ++loads_;
  // Until the file was read nobody is admitted, also if that ends by an exception; and the next
  // call reads it again, since it may have been for want of a descriptor or memory.
  const bool was_open = std::exchange(keys_, nobody_)->is_open;
  seen_ = {.exists = true};  // the mark of no file
  Status read = load(was_open);
  if (read) {
    seen_ = mark;
    log::info("API keys read", {{"keys", keys_->by_id.size()}});
  } else if (status_.ok() || status_.error().message() != read.error().message()) {
    log::error("API keys cannot be read: nobody is admitted", {{"error", read.error().message()}});
  }
  status_ = std::move(read);
  return keys_;
}

Status KeyRing::load(bool was_open) const {
  VOXELD_ASSIGN(auto list, read_keys(file_));
  if (!list) {
    if (was_open) keys_ = open_;
    if (was_open) return {};
    return Error{ErrorCode::kInternal, file_.string() + " is gone", "", ""};
  }
  // The maps point into the list: it is made where it stays.
  auto keys = std::make_shared<Keys>();
  keys->list = *std::move(list);
  for (const ApiKey& key : keys->list) {
    keys->by_id.emplace(key.id, &key);
    keys->by_tenant[key.tenant].push_back(key);
  }
  keys_ = std::move(keys);
  return {};
}

}  // namespace voxeld
