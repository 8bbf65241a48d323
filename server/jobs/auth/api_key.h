// API keys: "vxk_<id>_<secret>". The id names the key in lists and logs; the secret is known to its
// holder alone, the daemon keeps its hash.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/jobs/model/tenant_limits.h"

namespace voxeld {

inline constexpr int64_t kKeyWeightMax = 1000;

struct ApiKey {
  std::string id;      // 8 of a-z and 2-7
  std::string tenant;  // a tenant may have several keys, so that one can take another's place
  // "sha256-…" of the secret's text. A slow hash would protect secrets that can be guessed; this
  // one has 256 random bits.
  std::string secret_hash;
  int64_t created_ms = 0;
  int64_t expires_ms = 0;  // 0: never
  int64_t revoked_ms = 0;  // 0: not revoked
  int64_t weight = 1;      // 1 to kKeyWeightMax: the tenant's share beside the others'
  bool is_admin = false;
  TenantLimits limits;

  bool is_live(int64_t now_ms) const {
    return revoked_ms == 0 && (expires_ms == 0 || now_ms < expires_ms);
  }
};

// A new key's id and secret, of the kernel's random bits.
struct KeySecret {
  std::string id;
  std::string secret;  // 52 of a-z and 2-7: 256 bits
  std::string text() const { return "vxk_" + id + "_" + secret; }
  std::string hash() const;
};
KeySecret make_key_secret();

// The parts of a key as it was presented; both empty where it is none.
struct PresentedKey {
  std::string_view id, secret;
};
PresentedKey split_key(std::string_view text);
bool is_key_id(std::string_view text);

// Takes as long for texts of one length wherever they differ.
bool equal_in_constant_time(std::string_view a, std::string_view b);

// 1 to 64 of a-z, 0-9, '.', '_' and '-', the first a letter or digit. Errors: invalid-option.
Status check_tenant_name(std::string_view name);

// When a key made now ends: "30d" (also h, w) from now, or "2026-12-31", the first day (UTC) on
// which it is void. Errors: invalid-option, also for the past.
Result<int64_t> parse_expiry(std::string_view text, int64_t now_ms);

}  // namespace voxeld
