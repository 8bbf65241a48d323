// Responses whose body is a stored file: validators and byte ranges (RFC 9110).
#pragma once

#include <string_view>

#include "proto/result.h"
#include "server/http/message/message.h"

namespace voxeld::http {

// 200 with the whole file, or 304, 206 or 416 by the request's If-None-Match, Range and If-Range.
// One range only; a list of ranges gets the whole file, and so does HEAD. The response to a method
// other than GET and HEAD is always the whole file. `etag` with its quotes.
Result<Response> file_response(const Head& head, const FileBody& file, std::string_view etag);

// Whether a header If-None-Match names `etag`, by weak comparison.
bool etag_matches(std::string_view list, std::string_view etag);

}  // namespace voxeld::http
