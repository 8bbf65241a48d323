// Who may ask: from an Authorization header to a Caller. Nothing else in the daemon looks at keys
// (but for KeyRing::admit, which this calls), and nothing else makes a Caller of a request.
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/http/message.h"
#include "server/jobs/key_ring.h"

namespace voxeld::http {

class Access {
 public:
  explicit Access(const KeyRing& keys) : keys_(keys) {}
  // Before a request is dispatched: sets its caller. All routes need a key but "/" and
  // /openapi.json, whose caller stays nobody. Errors: unauthorized, in the same words whatever is
  // wrong with the key.
  Status admit(Request& request) const;
  // For answers that go on for long: whether the key that a request came with still counts.
  bool still_admits(std::string_view key_id) const { return keys_.is_live(key_id); }

 private:
  const KeyRing& keys_;
};

}  // namespace voxeld::http
