#include "server/keys.h"

#include <time.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "server/base/clock.h"
#include "server/exit_status.h"
#include "server/jobs/auth/key_changes.h"
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

// Returns once a running daemon follows the change: after its check interval.
void wait_for_daemon() {
  std::this_thread::sleep_for(KeyRing::kCheckInterval);
}

KeySettings settings_of(const KeysCommand& command) {
  return {command.weight, command.rate, command.queued_jobs, command.bytes, command.cells};
}

Status add(const KeysCommand& command) {
  VOXELD_ASSIGN(const AddedKey added,
                add_key(command.data_dir,
                        {command.tenant, command.is_admin, command.expires, settings_of(command)}));
  wait_for_daemon();
  const ApiKey& key = added.key;
  const std::string until =
      key.expires_ms == 0 ? "" : ", until " + time_text(key.expires_ms) + " UTC";
  std::fprintf(stderr, "key %s of %s %s%s; it cannot be shown again:\n", key.id.c_str(),
               key.is_admin ? "admin" : "tenant", key.tenant.c_str(), until.c_str());
  std::printf("%s\n", added.secret_text.c_str());
  return {};
}

std::string limit_text(int64_t limit) {
  return limit == 0 ? "-" : std::to_string(limit);
}

void print_table(const KeyList& keys) {
  const int64_t now_ms = unix_time_ms();
  std::printf("%-9s %-24s %-7s %6s %9s %7s %14s %14s %-16s %-16s %s\n", "ID", "NAME", "ROLE",
              "WEIGHT", "RATE", "QUEUED", "BYTES", "CELLS", "CREATED", "EXPIRES", "STATE");
  for (const ApiKey& key : keys) {
    const TenantLimits& limits = key.limits;
    std::printf("%-9s %-24s %-7s %6lld %9s %7s %14s %14s %-16s %-16s %s\n", key.id.c_str(),
                key.tenant.c_str(), key.is_admin ? "admin" : "tenant",
                static_cast<long long>(key.weight), rate_text(limits.requests_per_minute).c_str(),
                limit_text(limits.queued_jobs).c_str(), limit_text(limits.bytes).c_str(),
                limit_text(limits.cells).c_str(), time_text(key.created_ms).c_str(),
                time_text(key.expires_ms).c_str(), std::string(key_state(key, now_ms)).c_str());
  }
}

Status list(const KeysCommand& command) {
  VOXELD_ASSIGN(const auto keys, read_keys(key_file_path(command.data_dir)));
  if (!command.json) {
    print_table(keys.value_or(KeyList()));
    return {};
  }
  nlohmann::json out = nlohmann::json::array();
  const int64_t now_ms = unix_time_ms();
  for (const ApiKey& key : keys.value_or(KeyList())) out.push_back(key_json(key, now_ms));
  std::printf("%s\n", out.dump(2).c_str());
  return {};
}

Status set(const KeysCommand& command) {
  VOXELD_TRY(set_key_limits(command.data_dir, command.id, settings_of(command)));
  wait_for_daemon();
  return {};
}

Status revoke(const KeysCommand& command) {
  VOXELD_TRY(revoke_key(command.data_dir, command.id, LastAdmin::kMayGo));
  wait_for_daemon();
  return {};
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
  const ErrorCode code = status.error().code;
  const bool is_usage = code == ErrorCode::kInvalidOption || code == ErrorCode::kNotFound;
  return is_usage ? kExitUsage : kExitFailure;
}

}  // namespace voxeld
