// Limits on the length of every text that a client chooses and that the daemon keeps or repeats.
// A longer text is refused with the limit and its length; it is neither stored nor echoed.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "proto/error_code.h"
#include "proto/limits.h"
#include "proto/palette.h"
#include "proto/result.h"

namespace voxeld {

struct ClientText {
  std::string_view name;  // as an error names it
  size_t bytes_max = 0;
  ErrorCode code = ErrorCode::kInvalidOption;  // for a longer text
};

namespace client_texts {
inline constexpr ClientText kFilename{"filename", 255};
inline constexpr ClientText kBundleFileName{"name", 255, ErrorCode::kMalformedBundle};
inline constexpr ClientText kAnimation{"animation", 255};
inline constexpr ClientText kVariant{"variant", 255};
// An id has 71 bytes. An asset's id may also carry a reading: a name of 255 bytes, each escaped as
// up to three (asset_id.h).
inline constexpr ClientText kAsset{"asset", 1024};
inline constexpr ClientText kGrid{"grid", 80}, kSequence{"sequence", 80};
// `after` of a list. The cursor of an asset list has an asset's id, a tenant's name and a number.
inline constexpr ClientText kCursor{"after", 1200};
// Any other option. The longest meaningful value is 16 numbers of 25 bytes.
inline constexpr ClientText kOption{"option", 1024};
// Each colour takes a number sign, six digits and a comma.
inline constexpr ClientText kPalette{"palette", 8 * kPaletteColorsMax};
// Per frame a number of 24 bytes and a comma.
inline constexpr ClientText kTimes{"times", size_t{25} * limits::kFramesMax};
inline constexpr ClientText kIdempotencyKey{"Idempotency-Key", 255, ErrorCode::kBadRequest};
inline constexpr ClientText kContentType{"Content-Type", 255, ErrorCode::kBadRequest};
// A longer X-Request-Id is replaced by an id that the daemon makes.
inline constexpr ClientText kRequestId{"X-Request-Id", 64, ErrorCode::kBadRequest};
// A link of POST …/share must fit into the target of a request.
inline constexpr ClientText kLink{"link", 8192};
// The path in `instance` of a problem document; a longer one is omitted.
inline constexpr ClientText kInstance{"instance", 255, ErrorCode::kBadRequest};
}  // namespace client_texts

// The most bytes of a client's text that an error repeats.
inline constexpr size_t kEchoBytesMax = 80;

// "filename: expected at most 255 bytes, got 300".
Status check_length(const ClientText& limit, std::string_view text);
// The same check under another name than the table's.
Status check_length(const ClientText& limit, std::string_view name, std::string_view text);
// Checks the length and refuses NUL: code that takes the text as a path would lose the rest.
Status check_filename(std::string_view filename);
// The beginning of `text` in quotes.
std::string echoed(std::string_view text);

}  // namespace voxeld
