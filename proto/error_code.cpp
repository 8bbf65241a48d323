#include "proto/error_code.h"

#include <algorithm>
#include <array>

namespace voxeld {
namespace {

using enum ErrorCode;

constexpr std::array kCodes = {
    ErrorCodeInfo{kBadRequest, "bad-request", 400, "The request is malformed"},
    ErrorCodeInfo{kUnknownOption, "unknown-option", 400, "There is no such option"},
    ErrorCodeInfo{kInvalidOption, "invalid-option", 400, "An option has an impossible value"},
    ErrorCodeInfo{kUnauthorized, "unauthorized", 401, "Credentials are missing or wrong"},
    ErrorCodeInfo{kForbidden, "forbidden", 403, "The request is not allowed"},
    ErrorCodeInfo{kNotFound, "not-found", 404, "There is no such thing"},
    ErrorCodeInfo{kMethodNotAllowed, "method-not-allowed", 405, "The method is not allowed here"},
    ErrorCodeInfo{kNotAcceptable, "not-acceptable", 406, "No acceptable format"},
    ErrorCodeInfo{kConflict, "conflict", 409, "The state does not allow it"},
    ErrorCodeInfo{kGone, "gone", 410, "It existed and is no longer there"},
    ErrorCodeInfo{kLengthRequired, "length-required", 411, "The body's length is needed"},
    ErrorCodeInfo{kPayloadTooLarge, "payload-too-large", 413, "The body is too large"},
    ErrorCodeInfo{kUnsupportedMedia, "unsupported-media-type", 415, "Not a format that is read"},
    ErrorCodeInfo{kRangeNotSatisfiable, "range-not-satisfiable", 416, "The range is outside"},
    ErrorCodeInfo{kMalformedMesh, "malformed-mesh", 422, "The mesh file is malformed"},
    ErrorCodeInfo{kEmptyMesh, "empty-mesh", 422, "The mesh has no triangles"},
    ErrorCodeInfo{kUnsupportedFeature, "unsupported-feature", 422, "A feature is not supported"},
    ErrorCodeInfo{kMalformedImage, "malformed-image", 422, "The image is malformed"},
    ErrorCodeInfo{kMalformedBundle, "malformed-bundle", 422, "The archive is malformed"},
    ErrorCodeInfo{kIdempotencyMismatch, "idempotency-mismatch", 422,
                  "The idempotency key belongs to another request"},
    ErrorCodeInfo{kGridTooLarge, "grid-too-large", 422, "The grid exceeds a limit"},
    ErrorCodeInfo{kTooManyRequests, "too-many-requests", 429, "Too many requests"},
    ErrorCodeInfo{kCancelled, "cancelled", 409, "The job was cancelled"},
    ErrorCodeInfo{kInternal, "internal", 500, "Something failed inside the service"},
    ErrorCodeInfo{kWorkerCrashed, "worker-crashed", 500, "The job ended its workers"},
    ErrorCodeInfo{kDeviceUnavailable, "device-unavailable", 503, "No device can run it now"},
    ErrorCodeInfo{kShuttingDown, "shutting-down", 503, "The service is shutting down"},
    ErrorCodeInfo{kQueueFull, "queue-full", 503, "The queue is full"},
    ErrorCodeInfo{kDeadlineExceeded, "deadline-exceeded", 504, "It took too long"},
    ErrorCodeInfo{kQuotaExceeded, "quota-exceeded", 507, "The tenant's storage is used up"},
    ErrorCodeInfo{kStorageFull, "storage-full", 507, "The storage is full"},
};

constexpr bool in_order_of_the_enum() {
  for (size_t i = 0; i < kCodes.size(); ++i) {
    if (static_cast<size_t>(kCodes[i].code) != i) return false;
  }
  return static_cast<size_t>(kStorageFull) + 1 == kCodes.size();
}
static_assert(in_order_of_the_enum());

}  // namespace

std::span<const ErrorCodeInfo> all_error_codes() {
  return kCodes;
}

const ErrorCodeInfo& info_of(ErrorCode code) {
  return kCodes[static_cast<size_t>(code)];
}

ErrorCode error_code_from_name(std::string_view name) {
  const auto it = std::ranges::find(kCodes, name, &ErrorCodeInfo::name);
  return it == kCodes.end() ? kInternal : it->code;
}

}  // namespace voxeld
