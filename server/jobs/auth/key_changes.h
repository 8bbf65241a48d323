// Changes of the key file, as `voxeld keys` and /v1/keys make them, and how both show a key.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/jobs/auth/api_key.h"

namespace voxeld {

// Weight and limits to set; an absent one stays. Limits of 0 are none.
struct KeySettings {
  std::optional<int64_t> weight = std::nullopt;       // 1 to kKeyWeightMax
  std::optional<std::string> rate = std::nullopt;     // as parse_rate() takes it: "10/s"
  std::optional<int64_t> queued_jobs = std::nullopt;  // 0 to kQueuedJobsLimitMax
  std::optional<int64_t> bytes = std::nullopt;        // 0 to kBytesLimitMax
  std::optional<int64_t> cells = std::nullopt;        // 0 to kCellsLimitMax
};

struct NewKey {
  std::string tenant;  // as check_tenant_name() takes it
  bool is_admin = false;
  std::string expires;  // as parse_expiry() takes it: "90d"; empty: never
  // An absent one is that of the tenant's newest live key: a key that takes another's place does
  // not lift the tenant's limits.
  KeySettings settings;
};

struct AddedKey {
  ApiKey key;
  std::string secret_text;  // "vxk_…"; the key file has its hash alone
};

// Whether the last live key of an admin may be revoked. Afterwards only the command line can make
// keys.
enum class LastAdmin { kMayGo, kStays };

// The three functions below change the file under its lock, and have the errors of change_keys()
// besides their own.

// Errors: invalid-option for a name, an expiry or a setting.
Result<AddedKey> add_key(const std::filesystem::path& data_dir, const NewKey& wanted);
// Applies the settings to all keys of the tenant that has the key `id`, and returns that key.
// Errors: not-found, invalid-option.
Result<ApiKey> set_key_limits(const std::filesystem::path& data_dir, std::string_view id,
                              const KeySettings& settings);
// Returns the key as it is then; one that is revoked already stays as it is. Errors: not-found,
// conflict for the last live key of an admin that stays.
Result<ApiKey> revoke_key(const std::filesystem::path& data_dir, std::string_view id,
                          LastAdmin last_admin);

// "live", "expired" or "revoked".
std::string_view key_state(const ApiKey& key, int64_t now_ms);
// The key without its hash, as `voxeld keys list --json` and /v1/keys have it. Times are Unix
// milliseconds, 0: never; limits of 0 are none.
nlohmann::json key_json(const ApiKey& key, int64_t now_ms);

}  // namespace voxeld
