// The address of a client that comes through proxies.
#pragma once

#include <string>
#include <vector>

#include "server/http/message/message.h"

namespace voxeld::http {

// The address that a request comes from: the peer's, or, if the peer is a trusted proxy, the last
// address of X-Forwarded-For that is not a trusted proxy's. Removes the headers that any client can
// make up (X-Forwarded-*, X-Real-IP, Forwarded) from `head`.
std::string take_client_address(Head& head, const std::string& peer,
                                const std::vector<std::string>& trusted_proxies);

}  // namespace voxeld::http
