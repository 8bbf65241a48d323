// Responses about jobs: their status, and the bytes that they made.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "proto/options/options.h"
#include "server/api/resources/api.h"

namespace voxeld::api {

// The bytes of an ended job with all headers, or the problem that it ended with; 304, 206 or 416 as
// the request asks.
Response job_result_response(const Request& request, Api& api, const JobStatus& status);
Response job_result_response(const Request& request, Api& api, const JobAndResult& found);
// The same, and where the request does not name the file: after `mesh`, the name of the job's mesh.
Response job_result_response(const Request& request, Api& api, const JobStatus& status,
                             std::string_view mesh);
// The name of a response's file: the stem of `filename=` (else of `mesh`, else of `own`) with the
// extension of `own`. Errors: invalid-option for a `filename=` that is too long.
Result<std::string> download_name(const Request& request, std::string_view mesh,
                                  std::string_view own);
// A status as JSON with its ETag. Long texts are read while the response is sent.
Response status_response(const Request& request, Api& api, int http_status,
                         const JobStatus& status);
// "queue;dur=1.2, parse;dur=3.4"
std::string server_timing(const JobStatus& status);
// Seconds of "Prefer: wait=N", clamped to kPreferWaitSecondsMax; 0 without it.
int preferred_wait_seconds(const Request& request);
// The format that `format=` or Accept asks for; nullopt: as it is, of type `own_type`.
// `media_type`: that of grids or of sequences, null for what has no other form. Errors:
// invalid-option, not-acceptable with the list of types.
using MediaTypeOf = std::string_view (*)(Format);
Result<std::optional<Format>> requested_format(Request& request, MediaTypeOf media_type,
                                               std::string_view own_type);

}  // namespace voxeld::api
