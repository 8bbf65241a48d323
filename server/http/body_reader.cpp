#include "server/http/body_reader.h"

#include <algorithm>
#include <charconv>

namespace voxeld::http {
namespace {

constexpr size_t kChunkLineMax = 256;
constexpr size_t kTrailerBytesMax = 8192;
constexpr size_t kReadAhead = 65536;

Error too_large(int64_t bytes_max, const std::string& got) {
  return {ErrorCode::kPayloadTooLarge, "the body is too large",
          "at most " + std::to_string(bytes_max) + " bytes", got};
}

Error bad_chunk(std::string detail) {
  return {ErrorCode::kBadRequest, "chunked body: " + std::move(detail), "", ""};
}

// Sizes, extensions and trailers: a bare line feed would end the line for a laxer reader.
Status check_controls(std::string_view line) {
  for (const char c : line) {
    if ((static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7f) {
      return bad_chunk("control character");
    }
  }
  return {};
}

Result<uint64_t> chunk_size(std::string_view line) {
  const std::string_view digits = line.substr(0, line.find(';'));
  uint64_t size = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), size, 16);
  if (digits.empty() || digits.size() > 15 || error != std::errc() ||
      end != digits.data() + digits.size()) {
    return bad_chunk("a chunk's size is not hexadecimal");
  }
  return size;
}

}  // namespace

Error slow_body_error() {
  return {ErrorCode::kDeadlineExceeded, "the body arrives too slowly",
          "at least " + std::to_string(kBodyRateMin) + " bytes per second", ""};
}

Result<bool> ChunkDecoder::feed(std::string& buffer,
                                const std::function<Status(std::string_view)>& sink) {
  size_t at = 0;
  const auto keep_rest = [&] { buffer.erase(0, at); };
  while (state_ != State::kDone) {
    const std::string_view rest = std::string_view(buffer).substr(at);
    if (state_ == State::kData) {
      const auto piece = rest.substr(0, std::min<uint64_t>(left_, rest.size()));
      if (piece.empty()) break;
      VOXELD_TRY(sink(piece));
      at += piece.size();
      left_ -= piece.size();
      if (left_ == 0) state_ = State::kDataEnd;
      continue;
    }
    if (state_ == State::kDataEnd) {
      if (rest.size() < 2) break;
      if (!rest.starts_with("\r\n")) return bad_chunk("a chunk is longer than it says");
      at += 2;
      state_ = State::kSize;
      continue;
    }
    const size_t end = rest.find("\r\n");
    // The same limit whether or not the line is whole yet: how the bytes came in pieces must not
    // matter.
    const size_t bytes = end != std::string_view::npos
                             ? end
                             : rest.size() - static_cast<size_t>(rest.ends_with('\r'));
    if (state_ == State::kSize && bytes > kChunkLineMax) return bad_chunk("a line is too long");
    if (state_ == State::kTrailer && trailer_bytes_ + bytes > kTrailerBytesMax) {
      return bad_chunk("trailers are too long");
    }
    if (end == std::string_view::npos) break;
    const std::string_view line = rest.substr(0, end);
    at += end + 2;
    VOXELD_TRY(check_controls(line));
    if (state_ == State::kSize) {
      VOXELD_ASSIGN(left_, chunk_size(line));
      state_ = left_ == 0 ? State::kTrailer : State::kData;
    } else {
      trailer_bytes_ += line.size();
      if (line.empty()) state_ = State::kDone;
    }
  }
  keep_rest();
  return state_ == State::kDone;
}

BodyReader::BodyReader(Connection& connection, const Head& head)
    : connection_(connection), head_(head), finished_(!head.has_body()) {
  std::string_view expect = head.header("Expect");
  // A client that sent some of the body with the head does not wait.
  expects_continue_ =
      !finished_ && !expect.empty() && head.minor == 1 && connection.buffer().empty();
}

Status BodyReader::more() {
  if (expects_continue_) connection_.send("HTTP/1.1 100 Continue\r\n\r\n");
  expects_continue_ = false;
  const auto elapsed = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - started_);
  const int64_t late = elapsed.count() - kBodyGraceSeconds;
  if (late > 0 && bytes_read_ < late * kBodyRateMin) return slow_body_error();
  if (connection_.receive_more(Clock::now() + std::chrono::seconds(kBodyGraceSeconds),
                               kReadAhead)) {
    return {};
  }
  if (connection_.broken()) {
    return Error{ErrorCode::kBadRequest, "the body ends early", "", ""};
  }
  return slow_body_error();
}

Status BodyReader::take(std::string_view piece, int64_t bytes_max,
                        const std::function<Status(std::span<const uint8_t>)>& sink) {
  bytes_read_ += static_cast<int64_t>(piece.size());
  if (bytes_read_ > bytes_max) return too_large(bytes_max, "more");
  return sink(std::span(reinterpret_cast<const uint8_t*>(piece.data()), piece.size()));
}

Status BodyReader::read_sized(int64_t bytes_max,
                              const std::function<Status(std::span<const uint8_t>)>& sink) {
  const int64_t length = *head_.content_length;
  if (length > bytes_max) return too_large(bytes_max, std::to_string(length));
  std::string& buffer = connection_.buffer();
  while (bytes_read_ < length) {
    if (buffer.empty()) {
      VOXELD_TRY(more());
    }
    const auto piece = std::min<size_t>(buffer.size(), static_cast<size_t>(length - bytes_read_));
    VOXELD_TRY(take(std::string_view(buffer).substr(0, piece), bytes_max, sink));
    buffer.erase(0, piece);
  }
  finished_ = true;
  return {};
}

Status BodyReader::read_chunked(int64_t bytes_max,
                                const std::function<Status(std::span<const uint8_t>)>& sink) {
  ChunkDecoder decoder;
  for (;;) {
    VOXELD_ASSIGN(const bool done, decoder.feed(connection_.buffer(), [&](std::string_view piece) {
      return take(piece, bytes_max, sink);
    }));
    if (done) break;
    VOXELD_TRY(more());
  }
  finished_ = true;
  return {};
}

Status BodyReader::read(int64_t bytes_max,
                        const std::function<Status(std::span<const uint8_t>)>& sink) {
  if (head_.coding == ContentCoding::kNone) return read_coded(bytes_max, sink);
  const auto decoder = make_content_decoder(head_.coding, bytes_max);
  const auto inflate = [&](std::span<const uint8_t> piece) { return decoder->feed(piece, sink); };
  VOXELD_TRY(read_coded(bytes_max, inflate));
  return decoder->finish();
}

Status BodyReader::read_coded(int64_t bytes_max,
                              const std::function<Status(std::span<const uint8_t>)>& sink) {
  if (head_.chunked) return read_chunked(bytes_max, sink);
  if (!head_.content_length) {
    return Error{ErrorCode::kLengthRequired, "the request has no body length",
                 "Content-Length, or Transfer-Encoding: chunked", "neither"};
  }
  return read_sized(bytes_max, sink);
}

Result<std::string> BodyReader::read_text(int64_t bytes_max) {
  std::string text;
  VOXELD_TRY(read(bytes_max, [&](std::span<const uint8_t> piece) -> Status {
    text.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return {};
  }));
  return text;
}

}  // namespace voxeld::http
