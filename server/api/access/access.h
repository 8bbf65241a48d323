// Authentication: from an Authorization header or a signed link to a Caller. Nothing else in the
// daemon looks at keys (except KeyRing::admit, which this calls) or makes a Caller of a request.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/api/access/rate_limit.h"
#include "server/api/access/signed_link.h"
#include "server/api/http_types.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/auth/url_secret.h"

namespace voxeld::api {

class Access {
 public:
  Access(const KeyRing& keys, const UrlSecrets& secrets) : keys_(keys), links_(secrets) {}
  // Sets the caller of a request and takes the parameters of a signed link out of its query. Called
  // before the request is dispatched to any route that is not for anyone. Errors: unauthorized, in
  // the same words whatever is wrong with the key; not-found and gone for links (signed_link.h);
  // too-many-requests by the tenant's limit.
  Status admit(Request& request);
  // Whether the key of a request that has waited is still valid.
  bool still_admits(std::string_view key_id) const { return keys_.is_live(key_id); }
  const SignedLinks& links() const { return links_; }

 private:
  const KeyRing& keys_;
  const SignedLinks links_;
  RateLimiter limiter_;
};

// The one error for a key that is missing, malformed, unknown, wrong, expired or revoked.
Error no_valid_key();

// The draft headers RateLimit-Policy and RateLimit, and Retry-After where the request was refused.
void add_rate_headers(const RateState& rate, Response& response);

}  // namespace voxeld::api
