// Decodes the body of a request as its bytes arrive: by Content-Length or chunked, inflated, never
// more than a cap.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/http/message/content_coding.h"
#include "server/http/message/message.h"

namespace voxeld::http {

// Average bytes per second that a body must reach after the first seconds; slower:
// deadline-exceeded.
inline constexpr int64_t kBodyRateMin = 1024;
inline constexpr int kBodyGraceSeconds = 20;
Error slow_body_error();
// The client closed its side before the end of the body.
Error short_body_error();

// Decodes chunked coding from a growing buffer (RFC 9112 section 7.1), strictly: hexadecimal sizes
// of at most 15 digits, CRLF, no control characters in extensions, bounded extensions and trailers.
class ChunkDecoder {
 public:
  // Takes what it can from `buffer` and gives pieces of the body to `sink`. False: more bytes are
  // needed; true: the body is complete and `buffer` begins with what follows it.
  Result<bool> feed(std::string& buffer, const std::function<Status(std::string_view)>& sink);

 private:
  enum class State { kSize, kData, kDataEnd, kTrailer, kDone };
  State state_ = State::kSize;
  uint64_t left_ = 0;
  size_t trailer_bytes_ = 0;
};

// Not thread-safe.
class BodyDecoder {
 public:
  using Sink = std::function<Status(std::span<const uint8_t>)>;
  // At most `bytes_max` bytes, both as they come and inflated. `head` must outlive the decoder.
  // Errors: payload-too-large if Content-Length says so, length-required if the request has neither
  // length nor chunks.
  static Result<BodyDecoder> open(const Head& head, int64_t bytes_max);

  // Takes the bytes of the body from `buffer` and gives them, inflated, to `sink`. True: the body
  // is whole, and `buffer` begins with what follows it. Errors: payload-too-large, bad-request for
  // broken chunks and codings, those of the sink.
  Result<bool> feed(std::string& buffer, const Sink& sink);
  // Bytes of the body so far, as they came.
  int64_t bytes_read() const { return bytes_read_; }

 private:
  BodyDecoder(const Head& head, int64_t bytes_max);
  Status take(std::string_view piece, const Sink& sink);
  Result<bool> feed_sized(std::string& buffer, const Sink& sink);

  const Head* head_;
  int64_t bytes_max_;
  int64_t bytes_read_ = 0;
  ChunkDecoder chunks_;
  std::unique_ptr<ContentDecoder> inflate_;  // null: the body is not compressed
};

}  // namespace voxeld::http
