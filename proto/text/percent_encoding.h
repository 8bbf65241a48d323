// Percent-encoding for URLs (RFC 3986, section 2.1).
#pragma once

#include <string>
#include <string_view>

namespace voxeld {

// Keeps unreserved characters (letters, digits, "-._~") and those of `also_plain`; each other byte
// becomes %XX. Correct for a path segment, and for a name or a value of a query.
std::string percent_encode(std::string_view text, std::string_view also_plain = {});

}  // namespace voxeld
