// Reads NRRD, the "nearly raw raster data" of teem: a text header, an empty line, and the samples,
// raw or in gzip. nrrd_fields.cpp reads the header.
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/volumes/dense_samples.h"
#include "server/volumes/nrrd_fields.h"
#include "server/volumes/volume_error.h"
#include "server/volumes/volume_files.h"

namespace voxeld::volumes {
namespace {

// Bytes that deflate makes of one, at most (RFC 1951: 258 bytes from two bits).
constexpr uint64_t kDeflateRatioMax = 1032;
// Bytes of samples in gzip: dense colours of floats of limits::kDenseCellsMax cells, as we write
// them. More: grid-too-large. They take about a minute.
constexpr uint64_t kInflatedBytesMax = uint64_t{1} << 35;

// Inflates one or more gzip members (RFC 1952) piece by piece.
class GzipPieces {
 public:
  explicit GzipPieces(std::span<const uint8_t> bytes) : rest_(bytes), out_(kPieceBytes) {
    constexpr int kGzipOnly = 16;  // zlib.h: added to the window's bits
    VOXELD_CHECK(::inflateInit2(&stream_, MAX_WBITS + kGzipOnly) == Z_OK, "inflateInit2");
  }
  ~GzipPieces() { ::inflateEnd(&stream_); }
  GzipPieces(const GzipPieces&) = delete;
  GzipPieces& operator=(const GzipPieces&) = delete;

  // The next piece, which lasts until the next call; empty at the end. False: broken() says why.
  bool next(std::span<const uint8_t>& piece) {
    stream_.next_out = out_.data();
    stream_.avail_out = static_cast<uInt>(out_.size());
    while (stream_.avail_out > 0) {
      if (stream_.avail_in == 0 && !rest_.empty()) feed();
      if (is_at_end_) {
        if (stream_.avail_in == 0) break;
        cancel_point();  // millions of members may hold nothing
        VOXELD_CHECK(::inflateReset(&stream_) == Z_OK, "inflateReset");
      }
      const int result = ::inflate(&stream_, Z_NO_FLUSH);
      is_at_end_ = result == Z_STREAM_END;
      if (result == Z_BUF_ERROR) {
        broken_ = "it ends early";
        return false;
      }
      if (result != Z_OK && result != Z_STREAM_END) {
        broken_ = stream_.msg == nullptr ? "broken data" : stream_.msg;
        return false;
      }
    }
    piece = std::span(out_).first(out_.size() - stream_.avail_out);
    return true;
  }
  const std::string& broken() const { return broken_; }

 private:
  static constexpr size_t kPieceBytes = size_t{1} << 18;
  static constexpr size_t kFeedBytesMax = size_t{1} << 30;  // zlib counts in 32 bits

  void feed() {
    const size_t bytes = std::min(rest_.size(), kFeedBytesMax);
    // zlib reads it only.
    stream_.next_in = const_cast<uint8_t*>(rest_.data());  // NOLINT(*-const-cast)
    stream_.avail_in = static_cast<uInt>(bytes);
    rest_ = rest_.subspan(bytes);
  }

  std::span<const uint8_t> rest_;
  z_stream stream_{};
  std::vector<uint8_t> out_;
  bool is_at_end_ = false;
  std::string broken_;
};

Error other_length(std::string_view name, uint64_t bytes, std::string got) {
  return malformed_volume(name, "data", "the samples are not those of the sizes",
                          std::to_string(bytes) + " bytes", std::move(got));
}

Result<std::vector<SparseTile>> tiles_of_gzip(const SampleArray& array, std::string_view name,
                                              std::span<const uint8_t> data) {
  const uint64_t bytes = array.bytes();
  if (bytes > kInflatedBytesMax) {
    return Error{ErrorCode::kGridTooLarge, std::string(name) + ": too many samples in gzip",
                 "at most " + std::to_string(kInflatedBytesMax) + " bytes", std::to_string(bytes)};
  }
  if (bytes / kDeflateRatioMax > data.size()) {
    return other_length(name, bytes, std::to_string(data.size()) + " in gzip, which hold fewer");
  }
  SampleStream samples(array, name);
  GzipPieces pieces(data);
  uint64_t taken = 0;
  while (true) {
    cancel_point();
    std::span<const uint8_t> piece;
    if (!pieces.next(piece)) {
      return malformed_volume(name, "data", "no whole gzip stream", "", pieces.broken());
    }
    if (piece.empty()) break;
    if (piece.size() > bytes - taken) return other_length(name, bytes, "more");
    taken += piece.size();
    VOXELD_TRY(samples.add(piece));
  }
  if (taken != bytes) return other_length(name, bytes, std::to_string(taken));
  return samples.finish();
}

}  // namespace

Result<Volume> read_nrrd(std::string_view name, std::span<const uint8_t> bytes, double threshold) {
  VOXELD_ASSIGN(NrrdFile file, read_nrrd_fields(name, bytes));
  file.array.threshold = threshold;
  const std::span<const uint8_t> data = bytes.subspan(file.data_begin);
  Volume volume;
  volume.grid.spec = file.spec;
  volume.grid.channels.color = file.array.has_color();
  if (file.is_gzip) {
    VOXELD_ASSIGN(volume.grid.tiles, tiles_of_gzip(file.array, name, data));
    return volume;
  }
  if (data.size() != file.array.bytes()) {
    return other_length(name, file.array.bytes(), std::to_string(data.size()));
  }
  VOXELD_ASSIGN(volume.grid.tiles, tiles_of_samples(file.array, name, data));
  return volume;
}

}  // namespace voxeld::volumes
