// HMAC-SHA256 (RFC 2104).
#pragma once

#include <string>
#include <string_view>

namespace voxeld {

// The HMAC as 64 lower-case hex digits.
std::string hmac_sha256(std::string_view key, std::string_view text);

}  // namespace voxeld
