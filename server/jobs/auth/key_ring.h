// The API keys of a running daemon, as their file says now.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/thread_annotations.h"
#include "server/jobs/auth/api_key.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/auth/private_file.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {

// Thread-safe. The file is read again when its stat(2) has changed, which is looked up at most once
// per interval, and before any key is refused. A new key therefore counts at once, a revoked one
// for at most an interval. A daemon that once had keys never becomes open again before its next
// start: without its file, or with one that it cannot read, it admits nobody.
class KeyRing {
 public:
  static constexpr std::chrono::milliseconds kCheckInterval{100};
  // Without a file: open. Errors: those of read_keys().
  static Result<std::unique_ptr<KeyRing>> open(
      const std::filesystem::path& data_dir,
      std::chrono::milliseconds check_interval = kCheckInterval);

  struct Holder {
    Caller caller;
    std::string key_id;  // empty where no key is needed
  };
  // The holder of a key; without any key in the file every caller is Caller::open(). nullopt for a
  // key that is malformed, unknown, wrong, expired or revoked, after the same work in each case.
  std::optional<Holder> admit(std::string_view presented) const;
  // Whether the key of that id would still be admitted.
  bool is_live(std::string_view key_id) const;

  // The weight of the tenant's newest live key; 1 for who has none.
  int64_t weight_of(std::string_view tenant) const;

  bool needs_keys() const { return !current()->is_open; }
  // More than one tenant has a live key.
  bool has_several_tenants() const;
  // The holder of the key of that id, as if it had been presented; for links that were signed in
  // its name. nullopt where is_live() is false.
  std::optional<Holder> holder_of(std::string_view key_id) const;
  // The limits of the tenant's newest live key; where none is live, but jobs may still wait, of the
  // newest that it had. None without keys.
  TenantLimits limits_of(std::string_view tenant) const;

  // A number that changes when a key is added, changed or revoked, or expires.
  uint64_t epoch() const;
  // Reads the file now if it has changed, so that a change of this process counts at once.
  void refresh() const EXCLUDES(mutex_) { current(Look::kNow); }
  // The directory with the key file.
  std::filesystem::path data_dir() const { return file_.parent_path(); }
  // Why nobody is admitted, if that is not what the file says.
  Status status() const EXCLUDES(mutex_);

 private:
  struct Keys {
    bool is_open = false;
    KeyList list;
    std::map<std::string_view, const ApiKey*> by_id;
    std::map<std::string_view, KeyList> by_tenant;
    const ApiKey* find(std::string_view id) const;
  };
  enum class Look { kWhenDue, kNow };
  KeyRing(std::filesystem::path file, std::chrono::milliseconds check_interval)
      : file_(std::move(file)), check_interval_(check_interval) {}
  std::shared_ptr<const Keys> current(Look look = Look::kWhenDue) const EXCLUDES(mutex_);
  // Sets keys_. `was_open`: without a file it stays so.
  Status load(bool was_open) const REQUIRES(mutex_);
  // The holder of the key among these.
  static std::optional<Holder> holder_among(const Keys& keys, std::string_view presented);

  const std::filesystem::path file_;
  const std::chrono::milliseconds check_interval_;
  const std::shared_ptr<const Keys> open_ = std::make_shared<const Keys>(Keys{true, {}, {}, {}});
  const std::shared_ptr<const Keys> nobody_ = std::make_shared<const Keys>();
  mutable Mutex mutex_;
  mutable FileMark seen_ GUARDED_BY(mutex_);  // of the file that keys_ are from
  mutable std::chrono::steady_clock::time_point check_at_ GUARDED_BY(mutex_);
  mutable uint32_t loads_ GUARDED_BY(mutex_) = 0;
  mutable std::shared_ptr<const Keys> keys_ GUARDED_BY(mutex_) = nobody_;
  mutable Status status_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
