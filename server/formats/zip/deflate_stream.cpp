#include "server/formats/zip/deflate_stream.h"

#include <zlib.h>

#include <algorithm>
#include <array>

namespace voxeld {
namespace {

constexpr std::array<uint8_t, 10> kGzipHead = {0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff};
constexpr std::array<uint8_t, 2> kZlibHead = {0x78, 0x01};
constexpr uint32_t kAdlerOfNothing = 1;

constexpr size_t kStoredHeadBytes = 5;
constexpr size_t kStoredBytesMax = UINT16_MAX;  // of a stored block (RFC 1951, 3.2.4)

std::array<uint8_t, 4> big_endian(uint32_t value) {
  return {static_cast<uint8_t>(value >> 24), static_cast<uint8_t>(value >> 16),
          static_cast<uint8_t>(value >> 8), static_cast<uint8_t>(value)};
}

std::array<uint8_t, 4> little_endian(uint32_t value) {
  return {static_cast<uint8_t>(value), static_cast<uint8_t>(value >> 8),
          static_cast<uint8_t>(value >> 16), static_cast<uint8_t>(value >> 24)};
}

std::vector<uint8_t> framed(std::span<const uint8_t> head, const DeflatedPiece& piece,
                            std::span<const uint8_t> sums) {
  const std::span<const uint8_t> end = Deflater::stream_end();
  std::vector<uint8_t> stream(head.size() + piece.deflated.size() + end.size() + sums.size());
  auto out = std::ranges::copy(head, stream.begin()).out;
  out = std::ranges::copy(piece.deflated, out).out;
  out = std::ranges::copy(end, out).out;
  std::ranges::copy(sums, out);
  return stream;
}

}  // namespace

DeflateStream::DeflateStream(OutputFile& file, Frame frame)
    : file_(file), frame_(frame), sum_(frame == Frame::kGzip ? 0 : kAdlerOfNothing) {}

Status DeflateStream::begin() {
  return frame_ == Frame::kGzip ? file_.append(kGzipHead) : file_.append(kZlibHead);
}

Status DeflateStream::begin_without(size_t first_bytes) {
  VOXELD_TRY(begin());
  first_at_ = file_.size();
  const size_t blocks = (first_bytes + kStoredBytesMax - 1) / kStoredBytesMax;
  return file_.extend(blocks * kStoredHeadBytes + first_bytes);
}

Status DeflateStream::finish(std::span<const uint8_t> first) {
  uint64_t at = first_at_;
  for (size_t begin = 0; begin < first.size(); begin += kStoredBytesMax) {
    const auto part = first.subspan(begin, std::min(kStoredBytesMax, first.size() - begin));
    const auto bytes = static_cast<uint16_t>(part.size());
    const auto low = static_cast<uint8_t>(bytes), high = static_cast<uint8_t>(bytes >> 8);
    const std::array<uint8_t, kStoredHeadBytes> head = {0, low, high, static_cast<uint8_t>(~low),
                                                        static_cast<uint8_t>(~high)};
    VOXELD_TRY(file_.replace(at, head));
    VOXELD_TRY(file_.replace(at + head.size(), part));
    at += head.size() + part.size();
  }
  const auto sum = adler32_z(kAdlerOfNothing, first.data(), first.size());
  sum_ = static_cast<uint32_t>(adler32_combine(sum, sum_, static_cast<z_off_t>(raw_bytes_)));
  return finish();
}

Status DeflateStream::append(const DeflatedPiece& piece) {
  const auto bytes = static_cast<z_off_t>(piece.raw_bytes);
  sum_ =
      static_cast<uint32_t>(frame_ == Frame::kGzip ? crc32_combine(sum_, piece.checksum, bytes)
                                                   : adler32_combine(sum_, piece.checksum, bytes));
  raw_bytes_ += piece.raw_bytes;
  return file_.append(piece.deflated);
}

Status DeflateStream::add(std::span<const uint8_t> bytes) {
  return deflate_bytes(bytes, checksum(),
                       [this](const DeflatedPiece& piece) { return append(piece); });
}

Status DeflateStream::add_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                                 const std::function<void(size_t, std::span<uint8_t>)>& fill,
                                 const Repeats& repeats) {
  return deflate_pieces(count, bytes_of, fill, repeats, checksum(),
                        [this](const DeflatedPiece& piece) { return append(piece); });
}

Status DeflateStream::add_pieces(size_t count,
                                 const std::function<void(size_t, std::vector<uint8_t>&)>& make,
                                 const Repeats& repeats) {
  const auto deflated = [&](size_t i) {
    static thread_local std::vector<uint8_t> raw;
    make(i, raw);
    return deflate_piece(raw, repeats, checksum());
  };
  return deflate_pieces(count, deflated,
                        [this](const DeflatedPiece& piece) { return append(piece); });
}

Status DeflateStream::finish() {
  VOXELD_TRY(file_.append(Deflater::stream_end()));
  if (frame_ == Frame::kZlib) return file_.append(big_endian(sum_));
  VOXELD_TRY(file_.append(little_endian(sum_)));
  return file_.append(little_endian(static_cast<uint32_t>(raw_bytes_)));
}

std::vector<uint8_t> zlib_stream(std::span<const uint8_t> raw, const Repeats& repeats) {
  const DeflatedPiece piece = deflate_piece(raw, repeats, Checksum::kAdler32);
  return framed(kZlibHead, piece, big_endian(piece.checksum));
}

std::vector<uint8_t> gzip_stream(std::span<const uint8_t> raw, const Repeats& repeats) {
  const DeflatedPiece piece = deflate_piece(raw, repeats, Checksum::kCrc32);
  std::array<uint8_t, 8> end{};
  const auto rest = std::ranges::copy(little_endian(piece.checksum), end.begin()).out;
  std::ranges::copy(little_endian(static_cast<uint32_t>(piece.raw_bytes)), rest);
  return framed(kGzipHead, piece, end);
}

}  // namespace voxeld
