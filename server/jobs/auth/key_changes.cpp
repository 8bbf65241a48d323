#include "server/jobs/auth/key_changes.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/text/number_text.h"
#include "server/base/clock.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {
namespace {

Status set_number(std::string_view name, const std::optional<int64_t>& wanted, int64_t min,
                  int64_t max, int64_t& value) {
  if (!wanted) return {};
  if (*wanted < min || *wanted > max) {
    return Error{ErrorCode::kInvalidOption, std::string(name), range_text(min, max),
                 std::to_string(*wanted)};
  }
  value = *wanted;
  return {};
}

Status apply(const KeySettings& settings, ApiKey& key) {
  TenantLimits& limits = key.limits;
  if (settings.rate) {
    VOXELD_ASSIGN(limits.requests_per_minute, parse_rate(*settings.rate));
  }
  VOXELD_TRY(set_number("weight", settings.weight, 1, kKeyWeightMax, key.weight));
  VOXELD_TRY(
      set_number("queued_jobs", settings.queued_jobs, 0, kQueuedJobsLimitMax, limits.queued_jobs));
  VOXELD_TRY(set_number("bytes", settings.bytes, 0, kBytesLimitMax, limits.bytes));
  return set_number("cells", settings.cells, 0, kCellsLimitMax, limits.cells);
}

Result<KeyList::iterator> find_key(KeyList& keys, std::string_view id) {
  const auto key = std::ranges::find(keys, id, &ApiKey::id);
  if (key != keys.end()) return key;
  // Text that is no id is not repeated: it may be a whole key.
  return Error{ErrorCode::kNotFound, "there is no such key",
               "an id of voxeld keys list, 8 of a-z and 2-7", is_key_id(id) ? std::string(id) : ""};
}

bool is_live_admin(const ApiKey& key, int64_t now_ms) {
  return key.is_admin && key.is_live(now_ms);
}

}  // namespace

Result<AddedKey> add_key(const std::filesystem::path& data_dir, const NewKey& wanted) {
  VOXELD_TRY(check_tenant_name(wanted.tenant));
  AddedKey added;
  ApiKey& key = added.key;
  key.tenant = wanted.tenant;
  key.created_ms = unix_time_ms();
  key.is_admin = wanted.is_admin;
  if (!wanted.expires.empty()) {
    VOXELD_ASSIGN(key.expires_ms, parse_expiry(wanted.expires, key.created_ms));
  }
  const Status done = change_keys(data_dir, [&](KeyList& keys) -> Status {
    if (const ApiKey* other = newest_key(keys, key.tenant, key.created_ms)) {
      key.weight = other->weight;
      key.limits = other->limits;
    }
    VOXELD_TRY(apply(wanted.settings, key));
    KeySecret secret = make_key_secret();
    while (std::ranges::count(keys, secret.id, &ApiKey::id) != 0) secret = make_key_secret();
    key.id = secret.id;
    key.secret_hash = secret.hash();
    added.secret_text = secret.text();
    keys.push_back(key);
    return {};
  });
  VOXELD_TRY(done);
  return added;
}

Result<ApiKey> set_key_limits(const std::filesystem::path& data_dir, std::string_view id,
                              const KeySettings& settings) {
  ApiKey changed;
  const Status done = change_keys(data_dir, [&](KeyList& keys) -> Status {
    VOXELD_ASSIGN(const auto key, find_key(keys, id));
    for (ApiKey& one : keys) {
      if (one.tenant == key->tenant) VOXELD_TRY(apply(settings, one));
    }
    changed = *key;
    return {};
  });
  VOXELD_TRY(done);
  return changed;
}

Result<ApiKey> revoke_key(const std::filesystem::path& data_dir, std::string_view id,
                          LastAdmin last_admin) {
  ApiKey revoked;
  const Status done = change_keys(data_dir, [&](KeyList& keys) -> Status {
    VOXELD_ASSIGN(const auto key, find_key(keys, id));
    const int64_t now_ms = unix_time_ms();
    const auto live_admins =
        std::ranges::count_if(keys, [&](const ApiKey& one) { return is_live_admin(one, now_ms); });
    if (last_admin == LastAdmin::kStays && is_live_admin(*key, now_ms) && live_admins == 1) {
      return Error{
          ErrorCode::kConflict,
          "this is the last live key of an admin: without it nobody could manage keys over "
          "HTTP",
          "another admin's key first, or voxeld keys revoke on the daemon's machine", key->id};
    }
    if (key->revoked_ms == 0) key->revoked_ms = now_ms;
    revoked = *key;
    return {};
  });
  VOXELD_TRY(done);
  return revoked;
}

std::string_view key_state(const ApiKey& key, int64_t now_ms) {
  if (key.revoked_ms != 0) return "revoked";
  return key.is_live(now_ms) ? "live" : "expired";
}

nlohmann::json key_json(const ApiKey& key, int64_t now_ms) {
  return {{"id", key.id},
          {"name", key.tenant},
          {"admin", key.is_admin},
          {"weight", key.weight},
          {"limits",
           {{"requests_per_minute", key.limits.requests_per_minute},
            {"queued_jobs", key.limits.queued_jobs},
            {"bytes", key.limits.bytes},
            {"cells", key.limits.cells}}},
          {"created_ms", key.created_ms},
          {"expires_ms", key.expires_ms},
          {"revoked_ms", key.revoked_ms},
          {"state", key_state(key, now_ms)}};
}

}  // namespace voxeld
