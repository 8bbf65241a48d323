#include "server/jobs/key_ring.h"

#include <sys/stat.h>

#include <algorithm>
#include <utility>

#include "server/base/log.h"
#include "server/base/sha256.h"
#include "server/jobs/job_record.h"
#include "server/jobs/key_file.h"

namespace voxeld {

Result<std::unique_ptr<KeyRing>> KeyRing::open(const std::filesystem::path& data_dir) {
  std::unique_ptr<KeyRing> ring(new KeyRing(key_file_path(data_dir)));
  {
    const MutexLock lock(ring->mutex_);
    Keys none;
    none.is_open = true;
    ring->keys_ = std::make_shared<const Keys>(std::move(none));
    ring->seen_ = mark_of(ring->file_);
    VOXELD_TRY(ring->load());
  }
  return ring;
}

std::optional<KeyRing::Holder> KeyRing::admit(std::string_view presented) const {
  const std::shared_ptr<const Keys> keys = current();
  if (keys->is_open) return Holder{Caller::open(), ""};
  static const ApiKey nobody{"", "", sha256_id("nobody"), 0, 0, 0, 1, false};
  const PresentedKey key = split_key(presented);
  const ApiKey* known = keys->find(key.id);
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
  const int64_t now_ms = unix_time_ms();
  int64_t weight = 1;
  for (const auto& [id, key] : keys->by_id) {
    if (key.tenant == tenant && key.is_live(now_ms)) weight = std::max(weight, key.weight);
  }
  return weight;
}

Status KeyRing::status() const {
  current();
  const MutexLock lock(mutex_);
  return status_;
}

const ApiKey* KeyRing::Keys::find(std::string_view id) const {
  const auto it = by_id.find(id);
  return it == by_id.end() ? nullptr : &it->second;
}

KeyRing::FileMark KeyRing::mark_of(const std::filesystem::path& file) {
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0) return {};
  return {true, info.st_ino, info.st_size, info.st_ctim.tv_sec, info.st_ctim.tv_nsec};
}

std::shared_ptr<const KeyRing::Keys> KeyRing::current() const {
  const MutexLock lock(mutex_);
  // Before the file is read: what changes after this is seen by the next call.
  const FileMark mark = mark_of(file_);
  if (mark == seen_) return keys_;
  seen_ = mark;
  status_ = load();
  if (status_) {
    log::info("API keys read", {{"keys", keys_->by_id.size()}});
  } else {
    keys_ = std::make_shared<const Keys>();
    log::error("API keys cannot be read: nobody is admitted",
               {{"error", status_.error().message()}});
  }
  return keys_;
}

Status KeyRing::load() const {
  VOXELD_ASSIGN(auto list, read_keys(file_));
  if (!list) {
    if (keys_->is_open) return {};
    return Error{ErrorCode::kInternal, file_.string() + " is gone", "", ""};
  }
  Keys keys;
  for (ApiKey& key : *list) {
    std::string id = key.id;
    keys.by_id.emplace(std::move(id), std::move(key));
  }
  keys_ = std::make_shared<const Keys>(std::move(keys));
  return {};
}

}  // namespace voxeld
