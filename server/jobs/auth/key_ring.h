// The API keys of a running daemon, as their file says now.
#pragma once

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

// Thread-safe. Every call looks at the file's stat(2) and reads it where it has changed, so that
// keys count, or no longer do, from the next request on. A daemon that once had keys never becomes
// open again before its next start: without its file, or with one that it cannot read, it admits
// nobody.
class KeyRing {
 public:
  // Without a file: open. Errors: those of read_keys().
  static Result<std::unique_ptr<KeyRing>> open(const std::filesystem::path& data_dir);

  struct Holder {
    Caller caller;
    std::string key_id;  // empty where no key is needed
  };
  // The holder of a key; without any key in the file every caller is Caller::open(). nullopt for a
  // key that is malformed, unknown, wrong, expired or revoked, after the same work in each case.
  std::optional<Holder> admit(std::string_view presented) const;
  // Whether the key of that id would still be admitted.
  bool is_live(std::string_view key_id) const;

  // The largest weight of the tenant's live keys; 1 for who has none.
  int64_t weight_of(std::string_view tenant) const;

  bool needs_keys() const { return !current()->is_open; }
  // More than one tenant has a live key.
  bool has_several_tenants() const;
  // The holder of the key of that id, as if it had been presented; for links that were signed in
  // its name. nullopt where is_live() is false.
  std::optional<Holder> holder_of(std::string_view key_id) const;
  // The limits of the tenant's newest live key; none without keys.
  TenantLimits limits_of(std::string_view tenant) const;

  // A number that changes when a key is added, changed or revoked, or expires.
  uint64_t epoch() const;
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
  explicit KeyRing(std::filesystem::path file) : file_(std::move(file)) {}
  std::shared_ptr<const Keys> current() const EXCLUDES(mutex_);
  Status load() const REQUIRES(mutex_);

  const std::filesystem::path file_;
  mutable Mutex mutex_;
  mutable FileMark seen_ GUARDED_BY(mutex_);
  mutable uint32_t loads_ GUARDED_BY(mutex_) = 0;
  mutable std::shared_ptr<const Keys> keys_ GUARDED_BY(mutex_);
  mutable Status status_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
