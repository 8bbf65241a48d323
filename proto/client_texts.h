// Limits on the length of every text that a client chooses and that the daemon keeps or repeats.
// A longer text is refused with the limit and its length; it is neither stored nor echoed.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "proto/error_code.h"
#include "proto/limits.h"
#include "proto/result.h"

namespace voxeld {

struct ClientText {
  std::string_view name;  // as an error names it
  size_t bytes_max = 0;
  ErrorCode code = ErrorCode::kInvalidOption;  // of a longer one
};

namespace client_texts {
inline constexpr ClientText kFilename{"filename", 255};
inline constexpr ClientText kBundleFileName{"name", 255, ErrorCode::kMalformedBundle};
inline constexpr ClientText kAnimation{"animation", 255};
// Ids have 71 bytes; that of an asset can say how it is read, by a name of 255 bytes of which each
// takes up to three (asset_id.h).
inline constexpr ClientText kAsset{"asset", 1024};
inline constexpr ClientText kGrid{"grid", 80}, kSequence{"sequence", 80};
// `after` of a list: that of assets has an id of one, a tenant's name and a number.
inline constexpr ClientText kCursor{"after", 1200};
// Any other option: 16 numbers of 25 bytes are the longest that has a meaning.
inline constexpr ClientText kOption{"option", 1024};
// A number of 24 bytes and a comma for each frame.
inline constexpr ClientText kTimes{"times", size_t{25} * limits::kFramesMax};
inline constexpr ClientText kIdempotencyKey{"Idempotency-Key", 255, ErrorCode::kBadRequest};
inline constexpr ClientText kContentType{"Content-Type", 255, ErrorCode::kBadRequest};
// A request whose X-Request-Id is longer gets an id of the daemon's own.
inline constexpr ClientText kRequestId{"X-Request-Id", 64, ErrorCode::kBadRequest};
// A link of POST …/share, which has to fit into the target of a request.
inline constexpr ClientText kLink{"link", 8192};
// The path in `instance` of a problem: a longer one is left out.
inline constexpr ClientText kInstance{"instance", 255, ErrorCode::kBadRequest};
}  // namespace client_texts

// Bytes of a client's text that an error repeats, at most.
inline constexpr size_t kEchoBytesMax = 80;

// "filename: expected at most 255 bytes, got 300".
Status check_length(const ClientText& limit, std::string_view text);
// The same, under another name than the table's.
Status check_length(const ClientText& limit, std::string_view name, std::string_view text);
// Its length, and no NUL: the rest of the text would be lost to whatever takes it as a path.
Status check_filename(std::string_view filename);
struct JobRequest;
// The lengths of its ids and of its filename.
Status check_texts(const JobRequest& request);
// The beginning of `text` in quotes.
std::string echoed(std::string_view text);

}  // namespace voxeld
