// Who may ask: from an Authorization header to a Caller. Nothing else in the daemon looks at keys
// (but for KeyRing::admit, which this calls), and nothing else makes a Caller of a request.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/http/message.h"
#include "server/http/rate_limit.h"
#include "server/http/signed_link.h"
#include "server/jobs/key_ring.h"
#include "server/jobs/url_secret.h"

namespace voxeld::http {

class Access {
 public:
  Access(const KeyRing& keys, const UrlSecrets& secrets) : keys_(keys), links_(secrets) {}
  // Before a request is dispatched: sets its caller, and takes the parameters of a signed link out
  // of its query. All routes need a key or a signature but "/" and /openapi.json, whose caller
  // stays nobody. Errors: unauthorized, in the same words whatever is wrong with the key; not-found
  // and gone for links (signed_link.h); too-many-requests by the tenant's limit.
  Status admit(Request& request);
  // For answers that go on for long: whether the key that a request came with still counts.
  bool still_admits(std::string_view key_id) const { return keys_.is_live(key_id); }
  const SignedLinks& links() const { return links_; }

 private:
  const KeyRing& keys_;
  const SignedLinks links_;
  RateLimiter limiter_;
};

// What is answered to a key that is missing, malformed, unknown, wrong, expired or revoked.
Error no_valid_key();

// The draft headers RateLimit-Policy and RateLimit, and Retry-After where the request was refused.
void add_rate_headers(const RateState& rate, Response& response);

}  // namespace voxeld::http
