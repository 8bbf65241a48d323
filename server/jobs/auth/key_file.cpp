#include "server/jobs/auth/key_file.h"

#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <utility>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/base/sha256.h"
#include "server/jobs/auth/private_file.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHead =
    "# voxeld keys 1: id tenant hash created_ms expires_ms revoked_ms weight role"
    " requests_per_minute queued_jobs bytes cells";
constexpr size_t kFields = 12;

// The error for a wrong field of a line.
Error wrong(std::string detail, std::string expected, std::string_view got) {
  return {ErrorCode::kInternal, std::move(detail), std::move(expected), echoed(got)};
}

// A number in decimal digits.
Result<int64_t> parse_field(std::string_view name, std::string_view text, int64_t min,
                            int64_t max) {
  if (const auto value = parse_number<int64_t>(text, min, max)) return *value;
  return wrong(std::string(name), range_text(min, max), text);
}

using Fields = std::array<std::string_view, kFields>;

Result<Fields> split_line(std::string_view line) {
  Fields fields;
  std::string_view rest = line;
  for (size_t i = 0; i < kFields; ++i) {
    const size_t end = i + 1 < kFields ? rest.find(' ') : rest.size();
    if (end == std::string_view::npos || end == 0) {
      return wrong("fields", std::to_string(kFields) + " between single spaces", line);
    }
    fields[i] = rest.substr(0, end);
    rest.remove_prefix(std::min(rest.size(), end + 1));
  }
  return fields;
}

Result<ApiKey> parse_line(std::string_view line) {
  constexpr int64_t kTimeMax = int64_t{1} << 53;
  VOXELD_ASSIGN(const Fields fields, split_line(line));
  const auto& [id, tenant, hash, created, expires, revoked, weight, role, rate, queued, bytes,
               cells] = fields;
  if (!is_key_id(id)) return wrong("id", "8 of a-z and 2-7", id);
  if (!check_tenant_name(tenant)) return wrong("tenant", "a tenant's name", tenant);
  if (!is_sha256_id(hash)) return wrong("hash", "sha256- and 64 hex digits", hash);
  if (role != "tenant" && role != "admin") return wrong("role", "tenant or admin", role);
  ApiKey key;
  key.id = id;
  key.tenant = tenant;
  key.secret_hash = hash;
  VOXELD_ASSIGN(key.created_ms, parse_field("created_ms", created, 0, kTimeMax));
  VOXELD_ASSIGN(key.expires_ms, parse_field("expires_ms", expires, 0, kTimeMax));
  VOXELD_ASSIGN(key.revoked_ms, parse_field("revoked_ms", revoked, 0, kTimeMax));
  VOXELD_ASSIGN(key.weight, parse_field("weight", weight, 1, kKeyWeightMax));
  key.is_admin = role == "admin";
  TenantLimits& limits = key.limits;
  VOXELD_ASSIGN(limits.requests_per_minute,
                parse_field("requests_per_minute", rate, 0, kRequestsPerMinuteMax));
  VOXELD_ASSIGN(limits.queued_jobs, parse_field("queued_jobs", queued, 0, kQueuedJobsLimitMax));
  VOXELD_ASSIGN(limits.bytes, parse_field("bytes", bytes, 0, kBytesLimitMax));
  VOXELD_ASSIGN(limits.cells, parse_field("cells", cells, 0, kCellsLimitMax));
  return key;
}

}  // namespace

fs::path key_file_path(const fs::path& data_dir) {
  return data_dir / "keys";
}

Result<KeyList> parse_keys(std::string_view text, const std::string& file) {
  KeyList keys;
  std::set<std::string> ids;
  int line_number = 0;
  const auto at_line = [&](Error error) {
    error.detail = file + " line " + std::to_string(line_number) + ": " + error.detail;
    return error;
  };
  while (!text.empty() || line_number == 0) {
    ++line_number;
    const size_t end = text.find('\n');
    if (end == std::string_view::npos) return at_line(wrong("it ends here", "a line feed", text));
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    if (line_number == 1) {
      if (line != kHead) return at_line(wrong("head", std::string(kHead), line));
      continue;
    }
    auto key = parse_line(line);
    if (!key) return at_line(std::move(key).error());
    if (!ids.insert(key->id).second) {
      return at_line(wrong("id", "one that no line before has", key->id));
    }
    keys.push_back(*std::move(key));
  }
  return keys;
}

std::string keys_text(const KeyList& keys) {
  std::string text(kHead);
  text += '\n';
  for (const ApiKey& key : keys) {
    text += key.id + " " + key.tenant + " " + key.secret_hash;
    for (const int64_t number : {key.created_ms, key.expires_ms, key.revoked_ms, key.weight}) {
      text += ' ';
      text += std::to_string(number);
    }
    text += key.is_admin ? " admin" : " tenant";
    const TenantLimits& limits = key.limits;
    for (const int64_t number :
         {limits.requests_per_minute, limits.queued_jobs, limits.bytes, limits.cells}) {
      text += ' ';
      text += std::to_string(number);
    }
    text += '\n';
  }
  return text;
}

Result<std::optional<KeyList>> read_keys(const fs::path& file) {
  VOXELD_ASSIGN(const auto text, read_private(file));
  if (!text) return std::optional<KeyList>();
  VOXELD_ASSIGN(KeyList keys, parse_keys(*text, file.string()));
  return std::optional(std::move(keys));
}

const ApiKey* newest_key(const KeyList& keys, std::string_view tenant,
                         std::optional<int64_t> live_at_ms) {
  const ApiKey* newest = nullptr;
  for (const ApiKey& key : keys) {
    if (key.tenant != tenant || (live_at_ms && !key.is_live(*live_at_ms))) continue;
    if (newest == nullptr || key.created_ms >= newest->created_ms) newest = &key;
  }
  return newest;
}

Status change_keys(const fs::path& data_dir, const std::function<Status(KeyList&)>& change) {
  const fs::path file = key_file_path(data_dir);
  VOXELD_ASSIGN(const UniqueFd lock, lock_private(file));
  VOXELD_ASSIGN(std::optional<KeyList> keys, read_keys(file));
  if (!keys) keys.emplace();
  VOXELD_TRY(change(*keys));
  return replace_private(file, keys_text(*keys));
}

}  // namespace voxeld
