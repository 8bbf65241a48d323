// Percent-encoding of what goes into URLs (RFC 3986, section 2.1).
#pragma once

#include <string>
#include <string_view>

namespace voxeld {

// Unreserved characters stay (letters, digits, "-._~"), and those of `also_plain`; each other byte
// becomes %XX. Right for a segment of a path, and for a name or a value of a query.
std::string percent_encode(std::string_view text, std::string_view also_plain = {});

}  // namespace voxeld
