// Content negotiation by the header Accept (RFC 9110, section 12.5.1).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

namespace voxeld::api {

// The number of the offered media type that the header gives the highest weight, the first of
// equals; nullopt if it accepts none. The weight of a type is that of the most specific range that
// matches it: "a/b" before "a/*" before "*/*". An empty header accepts all. Parameters of ranges
// other than `q` are ignored; a range that cannot be read matches nothing.
std::optional<size_t> preferred_type(std::string_view accept,
                                     std::span<const std::string_view> offered);

// Whether the header Accept-Encoding takes gzip (RFC 9110, section 12.5.3). Without the header a
// client gets plain bytes, which every client can read.
bool accepts_gzip(std::string_view accept_encoding);

}  // namespace voxeld::api
