#include "server/http/message/content_coding.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <string>

#include "proto/text/client_texts.h"
#include "server/base/check.h"

namespace voxeld::http {
namespace {

constexpr size_t kPieceBytes = 65536;
constexpr size_t kFeedBytesMax = size_t{1} << 30;  // zlib counts in 32 bits

Error broken(std::string_view coding, std::string_view what) {
  return {ErrorCode::kBadRequest, "the body is no whole " + std::string(coding) + " stream", "",
          std::string(what)};
}

// Counts what goes through a decoder.
class Caps {
 public:
  explicit Caps(int64_t bytes_max) : bytes_max_(bytes_max) {}
  void take(size_t bytes) { compressed_ += static_cast<int64_t>(bytes); }
  Status give(std::span<const uint8_t> piece, const ContentDecoder::Sink& sink) {
    inflated_ += static_cast<int64_t>(piece.size());
    if (inflated_ > bytes_max_) {
      return Error{ErrorCode::kPayloadTooLarge, "the body is too large when it is inflated",
                   "at most " + std::to_string(bytes_max_) + " bytes", "more"};
    }
    if (inflated_ > kInflateFreeBytes && inflated_ / kInflateRatioMax > compressed_) {
      return Error{ErrorCode::kPayloadTooLarge, "the body inflates too far",
                   "at most " + std::to_string(kInflateRatioMax) + " times its bytes", "more"};
    }
    return piece.empty() ? Status() : sink(piece);
  }

 private:
  const int64_t bytes_max_;
  int64_t compressed_ = 0, inflated_ = 0;
};

// One or more members (RFC 1952 section 2.2).
class GzipDecoder final : public ContentDecoder {
 public:
  explicit GzipDecoder(int64_t bytes_max) : caps_(bytes_max) {
    constexpr int kGzipOnly = 16;  // zlib.h: added to the window's bits
    VOXELD_CHECK(::inflateInit2(&stream_, MAX_WBITS + kGzipOnly) == Z_OK, "inflateInit2");
  }
  ~GzipDecoder() override { ::inflateEnd(&stream_); }
  GzipDecoder(const GzipDecoder&) = delete;
  GzipDecoder& operator=(const GzipDecoder&) = delete;

  Status feed(std::span<const uint8_t> piece, const Sink& sink) override {
    while (!piece.empty()) {
      const size_t bytes = std::min(piece.size(), kFeedBytesMax);
      VOXELD_TRY(feed_some(piece.first(bytes), sink));
      piece = piece.subspan(bytes);
    }
    return {};
  }
  Status finish() override { return at_end_ ? Status() : Status(broken("gzip", "it ends early")); }

 private:
  Status feed_some(std::span<const uint8_t> piece, const Sink& sink) {
    caps_.take(piece.size());
    // zlib reads it only.
    stream_.next_in = const_cast<uint8_t*>(piece.data());  // NOLINT(*-const-cast)
    stream_.avail_in = static_cast<uInt>(piece.size());
    while (true) {
      if (at_end_ && stream_.avail_in == 0) return {};
      if (at_end_) VOXELD_CHECK(::inflateReset(&stream_) == Z_OK, "inflateReset");
      stream_.next_out = out_.data();
      stream_.avail_out = static_cast<uInt>(out_.size());
      const int result = ::inflate(&stream_, Z_NO_FLUSH);
      const size_t made = out_.size() - stream_.avail_out;
      at_end_ = result == Z_STREAM_END;
      if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR) {
        return broken("gzip", stream_.msg == nullptr ? "" : stream_.msg);
      }
      VOXELD_TRY(caps_.give(std::span(out_).first(made), sink));
      if (!at_end_ && stream_.avail_in == 0 && stream_.avail_out > 0) return {};
    }
  }

  Caps caps_;
  z_stream stream_{};
  std::array<uint8_t, kPieceBytes> out_{};
  bool at_end_ = false;
};

// One or more frames (RFC 8878).
class ZstdDecoder final : public ContentDecoder {
 public:
  explicit ZstdDecoder(int64_t bytes_max) : caps_(bytes_max), stream_(ZSTD_createDStream()) {
    VOXELD_CHECK(stream_ != nullptr, "ZSTD_createDStream");
    ZSTD_DCtx_setParameter(stream_.get(), ZSTD_d_windowLogMax, kZstdWindowLogMax);
  }

  Status feed(std::span<const uint8_t> piece, const Sink& sink) override {
    caps_.take(piece.size());
    ZSTD_inBuffer in{piece.data(), piece.size(), 0};
    while (true) {
      ZSTD_outBuffer out{out_.data(), out_.size(), 0};
      const size_t left = ZSTD_decompressStream(stream_.get(), &out, &in);
      if (ZSTD_isError(left) != 0) return broken("zstd", ZSTD_getErrorName(left));
      at_end_ = left == 0;
      VOXELD_TRY(caps_.give(std::span(out_).first(out.pos), sink));
      if (in.pos == in.size && out.pos < out.size) return {};
      if (in.pos == in.size && at_end_) return {};
    }
  }
  Status finish() override { return at_end_ ? Status() : Status(broken("zstd", "it ends early")); }

 private:
  struct Free {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  Caps caps_;
  std::unique_ptr<ZSTD_DStream, Free> stream_;
  std::array<uint8_t, kPieceBytes> out_{};
  bool at_end_ = false;
};

}  // namespace

Result<ContentCoding> parse_content_coding(std::string_view text) {
  std::string name(text);
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  });
  if (name.empty() || name == "identity") return ContentCoding::kNone;
  if (name == "gzip" || name == "x-gzip") return ContentCoding::kGzip;
  if (name == "zstd") return ContentCoding::kZstd;
  return Error{ErrorCode::kUnsupportedMedia, "Content-Encoding of the request",
               "gzip or zstd, once, or identity", echoed(name)};
}

std::unique_ptr<ContentDecoder> make_content_decoder(ContentCoding coding, int64_t bytes_max) {
  VOXELD_CHECK(coding != ContentCoding::kNone, "there is nothing to decode");
  if (coding == ContentCoding::kGzip) return std::make_unique<GzipDecoder>(bytes_max);
  return std::make_unique<ZstdDecoder>(bytes_max);
}

}  // namespace voxeld::http
