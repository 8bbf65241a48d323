#include "server/keys.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include "server/base/clock.h"
#include "server/exit_status.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/auth/url_secret.h"

namespace voxeld {
namespace {

// "2026-12-31 23:59", UTC; "-" for never.
std::string time_text(int64_t ms) {
  if (ms == 0) return "-";
  const time_t seconds = ms / 1000;
  tm date{};
  ::gmtime_r(&seconds, &date);
  std::array<char, 32> text{};
  const size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", &date);
  return {text.data(), length};
}

std::string_view state_of(const ApiKey& key) {
  if (key.revoked_ms != 0) return "revoked";
  return key.is_live(unix_time_ms()) ? "live" : "expired";
}

// Applies the given weight and limits to `key`; the rest stays.
Status apply(const KeysCommand& command, ApiKey& key) {
  TenantLimits& limits = key.limits;
  if (command.rate) {
    VOXELD_ASSIGN(limits.requests_per_minute, parse_rate(*command.rate));
  }
  key.weight = command.weight.value_or(key.weight);
  limits.queued_jobs = command.queued_jobs.value_or(limits.queued_jobs);
  limits.bytes = command.bytes.value_or(limits.bytes);
  limits.cells = command.cells.value_or(limits.cells);
  return {};
}

Result<KeyList::iterator> find_key(KeyList& keys, const std::string& id) {
  if (!is_key_id(id)) {
    // Not what was given: it may be a whole key.
    return Error{ErrorCode::kInvalidOption, "ID", "8 of a-z and 2-7, as voxeld keys list shows",
                 ""};
  }
  const auto key = std::ranges::find(keys, id, &ApiKey::id);
  if (key != keys.end()) return key;
  return Error{ErrorCode::kInvalidOption, "there is no such key", "an id of voxeld keys list", id};
}

// Changes the keys. Returns once a running daemon follows the change: after its check interval.
Status change(const KeysCommand& command, const std::function<Status(KeyList&)>& edit) {
  VOXELD_TRY(change_keys(command.data_dir, edit));
  std::this_thread::sleep_for(KeyRing::kCheckInterval);
  return {};
}

Status add(const KeysCommand& command) {
  VOXELD_TRY(check_tenant_name(command.tenant));
  ApiKey key;
  key.tenant = command.tenant;
  key.created_ms = unix_time_ms();
  key.is_admin = command.is_admin;
  if (!command.expires.empty()) {
    VOXELD_ASSIGN(key.expires_ms, parse_expiry(command.expires, key.created_ms));
  }
  KeySecret secret;
  const Status changed = change(command, [&](KeyList& keys) -> Status {
    do {
      secret = make_key_secret();
    } while (std::ranges::count(keys, secret.id, &ApiKey::id) != 0);
    // A key that takes another's place does not lift the tenant's limits.
    if (const ApiKey* other = newest_live_key(keys, key.tenant, key.created_ms)) {
      key.weight = other->weight;
      key.limits = other->limits;
    }
    VOXELD_TRY(apply(command, key));
    key.id = secret.id;
    key.secret_hash = secret.hash();
    keys.push_back(key);
    return {};
  });
  VOXELD_TRY(changed);
  const std::string until =
      key.expires_ms == 0 ? "" : ", until " + time_text(key.expires_ms) + " UTC";
  std::fprintf(stderr, "key %s of %s %s%s; it cannot be shown again:\n", key.id.c_str(),
               key.is_admin ? "admin" : "tenant", key.tenant.c_str(), until.c_str());
  std::printf("%s\n", secret.text().c_str());
  return {};
}

std::string limit_text(int64_t limit) {
  return limit == 0 ? "-" : std::to_string(limit);
}

void print_table(const KeyList& keys) {
  std::printf("%-9s %-24s %-7s %6s %9s %7s %14s %14s %-16s %-16s %s\n", "ID", "NAME", "ROLE",
              "WEIGHT", "RATE", "QUEUED", "BYTES", "CELLS", "CREATED", "EXPIRES", "STATE");
  for (const ApiKey& key : keys) {
    const TenantLimits& limits = key.limits;
    std::printf("%-9s %-24s %-7s %6lld %9s %7s %14s %14s %-16s %-16s %s\n", key.id.c_str(),
                key.tenant.c_str(), key.is_admin ? "admin" : "tenant",
                static_cast<long long>(key.weight), rate_text(limits.requests_per_minute).c_str(),
                limit_text(limits.queued_jobs).c_str(), limit_text(limits.bytes).c_str(),
                limit_text(limits.cells).c_str(), time_text(key.created_ms).c_str(),
                time_text(key.expires_ms).c_str(), std::string(state_of(key)).c_str());
  }
}

Status list(const KeysCommand& command) {
  VOXELD_ASSIGN(const auto keys, read_keys(key_file_path(command.data_dir)));
  if (!command.json) {
    print_table(keys.value_or(KeyList()));
    return {};
  }
  nlohmann::json out = nlohmann::json::array();
  for (const ApiKey& key : keys.value_or(KeyList())) {
    out.push_back({{"id", key.id},
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
                   {"state", state_of(key)}});
  }
  std::printf("%s\n", out.dump(2).c_str());
  return {};
}

Status set(const KeysCommand& command) {
  return change(command, [&](KeyList& keys) -> Status {
    VOXELD_ASSIGN(const auto key, find_key(keys, command.id));
    for (ApiKey& one : keys) {
      if (one.tenant == key->tenant) VOXELD_TRY(apply(command, one));
    }
    return {};
  });
}

Status revoke(const KeysCommand& command) {
  return change(command, [&](KeyList& keys) -> Status {
    VOXELD_ASSIGN(const auto key, find_key(keys, command.id));
    if (key->revoked_ms == 0) key->revoked_ms = unix_time_ms();
    return {};
  });
}

Status run(const KeysCommand& command) {
  switch (command.action) {
    case KeysCommand::Action::kAdd:
      return add(command);
    case KeysCommand::Action::kSet:
      return set(command);
    case KeysCommand::Action::kRotateUrls:
      return rotate_url_secret(command.data_dir);
    case KeysCommand::Action::kList:
      return list(command);
    case KeysCommand::Action::kRevoke:
      return revoke(command);
  }
  return {};
}

}  // namespace

int keys_main(const KeysCommand& command) {
  const Status status = run(command);
  if (status) return 0;
  std::fprintf(stderr, "voxeld: %s\n", status.error().message().c_str());
  return status.error().code == ErrorCode::kInvalidOption ? kExitUsage : kExitFailure;
}

}  // namespace voxeld
