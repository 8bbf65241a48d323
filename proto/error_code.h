// The closed set of expected failures. Each code fixes its wire name and its HTTP status, and has
// one test that provokes it (tests/integration/test_errors.py counts them).
#pragma once

#include <span>
#include <string_view>

namespace voxeld {

enum class ErrorCode {
  kBadRequest,           // 400 bad-request: the HTTP request itself is malformed
  kUnknownOption,        // 400 unknown-option: a parameter that does not exist
  kInvalidOption,        // 400 invalid-option: a parameter with a value it cannot take
  kUnauthorized,         // 401 unauthorized: no valid API key
  kForbidden,            // 403 forbidden: a web page, Host name or tenant that is not allowed
  kNotFound,             // 404 not-found
  kMethodNotAllowed,     // 405 method-not-allowed
  kNotAcceptable,        // 406 not-acceptable: no format that the Accept header allows
  kConflict,             // 409 conflict: e.g. the result of a job that has not finished
  kGone,                 // 410 gone: an asset that was deleted
  kLengthRequired,       // 411 length-required
  kPayloadTooLarge,      // 413 payload-too-large
  kUnsupportedMedia,     // 415 unsupported-media-type: not a format that voxeld reads
  kRangeNotSatisfiable,  // 416 range-not-satisfiable
  kMalformedMesh,        // 422 malformed-mesh: the file breaks its format's rules
  kEmptyMesh,            // 422 empty-mesh: a valid file without any triangle
  kUnsupportedFeature,   // 422 unsupported-feature: e.g. a required glTF extension
  kMalformedImage,       // 422 malformed-image: a texture that cannot be decoded, when asked for
  kMalformedBundle,      // 422 malformed-bundle: a zip that is broken or hostile
  kIdempotencyMismatch,  // 422 idempotency-mismatch: same key, other request
  kGridTooLarge,         // 422 grid-too-large: over a limit; found before anything is computed
  kTooManyRequests,      // 429 too-many-requests
  kCancelled,            // 409 cancelled: the job was cancelled
  kInternal,             // 500 internal: a bug, or a driver that failed
  kWorkerCrashed,        // 500 worker-crashed: the job ended three workers
  kDeviceUnavailable,    // 503 device-unavailable: no worker can run it now
  kShuttingDown,         // 503 shutting-down
  kQueueFull,            // 503 queue-full
  kDeadlineExceeded,     // 504 deadline-exceeded
  kQuotaExceeded,        // 507 quota-exceeded: the tenant's storage is used up
  kStorageFull,          // 507 storage-full
};

struct ErrorCodeInfo {
  ErrorCode code;
  std::string_view name;  // wire name, stable
  int http_status;
  std::string_view title;  // short human sentence for problem+json
};

// All codes in the order of the enum.
std::span<const ErrorCodeInfo> all_error_codes();
const ErrorCodeInfo& info_of(ErrorCode code);
// Returns kInternal for an unknown name, which a newer server may send.
ErrorCode error_code_from_name(std::string_view name);

}  // namespace voxeld
