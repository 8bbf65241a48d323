#include "server/http/message/body_decoder.h"

#include <algorithm>
#include <charconv>

namespace voxeld::http {
namespace {

constexpr size_t kChunkLineMax = 256;
constexpr size_t kTrailerBytesMax = 8192;

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

Error short_body_error() {
  return {ErrorCode::kBadRequest, "the body ends early", "", ""};
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

BodyDecoder::BodyDecoder(const Head& head, int64_t bytes_max)
    : head_(&head), bytes_max_(bytes_max) {
  if (head.coding != ContentCoding::kNone) inflate_ = make_content_decoder(head.coding, bytes_max);
}

Result<BodyDecoder> BodyDecoder::open(const Head& head, int64_t bytes_max) {
  if (!head.chunked && !head.content_length) {
    return Error{ErrorCode::kLengthRequired, "the request has no body length",
                 "Content-Length, or Transfer-Encoding: chunked", "neither"};
  }
  if (!head.chunked && *head.content_length > bytes_max) {
    return too_large(bytes_max, std::to_string(*head.content_length));
  }
  return BodyDecoder(head, bytes_max);
}

Status BodyDecoder::take(std::string_view piece, const Sink& sink) {
  bytes_read_ += static_cast<int64_t>(piece.size());
  if (bytes_read_ > bytes_max_) return too_large(bytes_max_, "more");
  const std::span bytes(reinterpret_cast<const uint8_t*>(piece.data()), piece.size());
  return inflate_ ? inflate_->feed(bytes, sink) : sink(bytes);
}

Result<bool> BodyDecoder::feed_sized(std::string& buffer, const Sink& sink) {
  const int64_t left = *head_->content_length - bytes_read_;
  const auto size = static_cast<size_t>(std::min<int64_t>(std::ssize(buffer), left));
  if (size > 0) {
    VOXELD_TRY(take(std::string_view(buffer).substr(0, size), sink));
    buffer.erase(0, size);
  }
  return bytes_read_ == *head_->content_length;
}

Result<bool> BodyDecoder::feed(std::string& buffer, const Sink& sink) {
  auto taken = head_->chunked
                   ? chunks_.feed(buffer, [&](std::string_view p) { return take(p, sink); })
                   : feed_sized(buffer, sink);
  if (taken.ok() && *taken && inflate_) {
    VOXELD_TRY(inflate_->finish());
  }
  return taken;
}

}  // namespace voxeld::http
