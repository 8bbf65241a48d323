// The body of a request, read in pieces: by Content-Length or chunked, never more than a cap, never
// slower than a minimum rate.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/http/connection.h"
#include "server/http/message.h"

namespace voxeld::http {

// Average bytes per second that a body must reach after the first seconds; slower:
// deadline-exceeded.
inline constexpr int64_t kBodyRateMin = 1024;
inline constexpr int kBodyGraceSeconds = 20;
Error slow_body_error();

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

class BodyReader {
 public:
  BodyReader(Connection& connection, const Head& head);

  // Gives the whole body, inflated where it comes compressed (content_coding.h), to `sink` piece by
  // piece. Errors: payload-too-large over `bytes_max`, compressed (at once when Content-Length says
  // so) or inflated, length-required when the request has neither length nor chunks, bad-request
  // for broken chunks and codings and bodies that end early, deadline-exceeded.
  Status read(int64_t bytes_max, const std::function<Status(std::span<const uint8_t>)>& sink);
  Result<std::string> read_text(int64_t bytes_max);
  // Whether the connection is at the end of this request: if not, it must close.
  bool finished() const { return finished_; }
  int64_t bytes_read() const { return bytes_read_; }

 private:
  Status take(std::string_view piece, int64_t bytes_max,
              const std::function<Status(std::span<const uint8_t>)>& sink);
  Status more();
  Status read_coded(int64_t bytes_max, const std::function<Status(std::span<const uint8_t>)>& sink);
  Status read_sized(int64_t bytes_max, const std::function<Status(std::span<const uint8_t>)>& sink);
  Status read_chunked(int64_t bytes_max,
                      const std::function<Status(std::span<const uint8_t>)>& sink);

  Connection& connection_;
  const Head& head_;
  bool finished_;
  bool expects_continue_;
  int64_t bytes_read_ = 0;
  Clock::time_point started_ = Clock::now();
};

}  // namespace voxeld::http
