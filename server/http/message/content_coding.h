// Bodies that come compressed (RFC 9110 section 8.4): gzip and zstd, decoded piece by piece under
// caps, so that a small body cannot become a large one unseen.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "proto/result.h"

namespace voxeld::http {

// Inflated over compressed bytes, of bodies that inflate to more than kInflateFreeBytes: above it
// payload-too-large. Meshes reach 20, texts of zeros some 1000.
inline constexpr int64_t kInflateRatioMax = 200;
inline constexpr int64_t kInflateFreeBytes = int64_t{1} << 20;
// The window that a zstd body may ask for (RFC 9659): 8 MiB; more: bad-request.
inline constexpr int kZstdWindowLogMax = 23;

enum class ContentCoding { kNone, kGzip, kZstd };

// The coding of a Content-Encoding: one, or none. Errors: unsupported-media-type.
Result<ContentCoding> parse_content_coding(std::string_view text);

// Not thread-safe.
class ContentDecoder {
 public:
  using Sink = std::function<Status(std::span<const uint8_t>)>;
  virtual ~ContentDecoder() = default;
  // Gives what the next piece inflates to, in pieces, to `sink`, never more than `bytes_max` in
  // all. Errors: bad-request for what is no such stream, payload-too-large, those of the sink.
  virtual Status feed(std::span<const uint8_t> piece, const Sink& sink) = 0;
  // That the stream is at its end. Errors: bad-request.
  virtual Status finish() = 0;
};
// `coding` is not kNone.
std::unique_ptr<ContentDecoder> make_content_decoder(ContentCoding coding, int64_t bytes_max);

}  // namespace voxeld::http
