// The strict parser of request heads (RFC 9112): what two readers could understand differently is
// refused, because that is how requests are smuggled past a proxy.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/http/message/message.h"

namespace voxeld::http {

// more: bad-request, and the connection closes
inline constexpr size_t kHeadBytesMax = size_t{32} * 1024;
inline constexpr size_t kTargetBytesMax = size_t{8} * 1024;
inline constexpr size_t kHeaderCountMax = 100;

// `text` is everything up to and with the empty line. Errors: bad-request for bare LF, NUL and
// other control characters, folded lines, spaces before a colon, a missing, second or malformed
// Host, a bad or second Content-Length, Content-Length with Transfer-Encoding, a transfer coding
// other than chunked, broken percent-encoding; unsupported-media-type for a Content-Encoding that
// is not decoded here.
Result<Head> parse_head(std::string_view text);

// Takes a head from the beginning of `buffer` and parses it. nullopt: it is not complete. `scanned`
// is the number of bytes without an end of a head, 0 before the first call; the head's bytes are
// searched once, however they arrive. Errors: those of parse_head(), and bad-request for a head
// over kHeadBytesMax or with a bare line feed where its end should be.
std::optional<Result<Head>> take_head(std::string& buffer, size_t& scanned);

// Decodes %XX; with `plus_is_space`, '+' too. NUL and control characters are refused.
Result<std::string> percent_decode(std::string_view text, bool plus_is_space, bool keep_slash);

}  // namespace voxeld::http
