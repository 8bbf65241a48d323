// What the resources share: the services they call and the shapes of their answers.
#pragma once

#include <atomic>
#include <string>
#include <string_view>

#include "proto/job.h"
#include "server/http/access.h"
#include "server/http/message.h"
#include "server/http/router.h"
#include "server/http/server.h"
#include "server/jobs/job_service.h"

namespace voxeld::http {

// Event streams at a time; more: too-many-requests. Each holds a request thread.
inline constexpr int kSubscribersMax = 32;
// A one-shot request waits this long for its job; then it becomes deadline-exceeded.
inline constexpr int kOneShotSecondsMax = 3600;

struct Api {
  JobService& jobs;
  const Access& access;
  const ServerConfig& config;
  std::atomic<int> subscribers{0};
  // The server drains: who only watches (event streams, long polls) is answered at once.
  std::atomic<bool> stopping{false};
};

// One function per resource file.
void add_one_shot_routes(Router& router, Api& api);
void add_asset_routes(Router& router, Api& api);
void add_job_routes(Router& router, Api& api);
void add_queue_routes(Router& router, Api& api);
void add_event_routes(Router& router, Api& api);
void add_result_routes(Router& router, Api& api);
void add_kept_routes(Router& router, Api& api);
void add_grid_routes(Router& router, Api& api);
void add_sequence_routes(Router& router, Api& api);
void add_me_routes(Router& router, Api& api);
void add_share_routes(Router& router, Api& api);
void add_index_routes(Router& router, Api& api);

// The problem of `error` for this request.
Response problem(const Request& request, const Error& error);

// --- grids.cpp
// What /v1/grids/{grid} and its render.png answer.
Response grid_response(Request& request, Api& api, const std::string& grid);
Response grid_picture(Request& request, Api& api, const std::string& grid);

// --- upload.cpp
struct Upload {
  BlobInfo blob;
  std::vector<BundleFile> bundle_files;  // when the body is a bundle manifest
  std::string filename, content_type;
  double ms = 0;
};
// Streams the body into the blob store. Errors: unsupported-media-type by Content-Type, bad-request
// for an empty body, those of the body and the store, quota-exceeded (before anything is read where
// Content-Length tells), and of bundle manifests malformed-bundle, not-found and gone for files
// that are not there.
Result<Upload> receive_upload(Request& request, Api& api);
Result<Asset> register_upload(const Request& request, Api& api, const Upload& upload);
// The file name that the request gives: `filename=`, else Content-Disposition, else empty.
std::string requested_filename(const Request& request);

// --- answers.cpp
// The bytes of a finished job with all headers; 304, 206, 416 as the request asks.
Response job_result_response(const Request& request, Api& api, const JobStatus& status);
// For calls that wait: whether the client has left, or the key that it came with no longer counts.
bool is_abandoned(const Request& request, const Api& api);
// The answer to a request whose key has ended while it waited, in the words for any other key that
// does not count; nullopt where it still does.
std::optional<Response> key_ended(const Request& request, const Api& api);
// Waits for a job and answers with its bytes or with its problem; cancels it when the client leaves
// and `transient` is set.
Response await_result(Request& request, Api& api, const JobStatus& submitted, bool transient);
// Submits a job that is cancelled when the client leaves, and answers as await_result().
Response run_transient(Request& request, Api& api, const JobRequest& job);
// "queue;dur=1.2, parse;dur=3.4"
std::string server_timing(const JobStatus& status);
// Seconds of "Prefer: wait=N", clamped to kPreferWaitSecondsMax; 0 where it is absent.
int preferred_wait_seconds(const Request& request);
// Writes a status as JSON with its ETag; one with long texts is read again while it is sent.
Response status_response(const Request& request, Api& api, int http_status,
                         const JobStatus& status);
// The format that `format=` or Accept asks for; nullopt: any. Errors: invalid-option,
// not-acceptable with the list of formats. Grids and sequences have types of their own.
using MediaTypeOf = std::string_view (*)(Format);
Result<std::optional<Format>> requested_format(Request& request,
                                               MediaTypeOf media_type = format_media_type);

}  // namespace voxeld::http
