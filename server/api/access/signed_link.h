// Links that expire: who has one may GET (or HEAD) exactly what it names, without a key.
//
//   /v1/grids/sha256-…/render.png?width=300&expires=1763778000&key=k3v7qz2m&signature=<64 hex>
//
// The signature is HMAC-SHA256, by a secret of the daemon (jobs/auth/url_secret.h), over these
// lines, each ended by a line feed, which none of them can contain: "voxeld link 1", "GET", expires
// (Unix seconds), key, path, then name and value of each other parameter in their order, decoded.
// `key` is the id of the API key in whose name it was made, empty on a daemon without keys: the
// link sees what that key sees, and ends with it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/api/http_types.h"
#include "server/jobs/auth/url_secret.h"

namespace voxeld::api {

inline constexpr int64_t kLinkSecondsMax = int64_t{30} * 24 * 3600;  // longer: invalid-option
inline constexpr int64_t kLinkSecondsDefault = 3600;

// Whether the request says of itself that it comes by a link.
bool is_signed_link(const Head& head);
// expires, key and signature: no option of any route.
bool is_link_parameter(std::string_view name);
// The error for a link that was not signed here: the same whether or not its target exists.
Error unknown_link();

class SignedLinks {
 public:
  explicit SignedLinks(const UrlSecrets& secrets) : secrets_(secrets) {}
  // Path and query to ask for. `path` is a route's, of unreserved characters and slashes.
  // Errors: internal.
  Result<std::string> make(std::string_view path, const OptionPairs& query, std::string_view key_id,
                           int64_t expires_s) const;
  // The id of the key in whose name the link of this request was made. Errors: not-found (any but
  // ours), gone (ours, expired).
  Result<std::string> verify(const Head& head) const;

 private:
  const UrlSecrets& secrets_;
};

}  // namespace voxeld::api
