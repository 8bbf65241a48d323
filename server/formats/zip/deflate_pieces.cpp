#include "server/formats/zip/deflate_pieces.h"

#include <libdeflate.h>

#include <algorithm>
#include <memory>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr size_t kPieceBytes = size_t{1} << 20;  // of bytes in memory
constexpr size_t kBatchPieces = 32;              // deflated together

}  // namespace

DeflatedPiece deflate_piece(std::span<const uint8_t> raw, const Repeats& repeats,
                            Checksum checksum) {
  static thread_local const auto deflater = std::make_unique<Deflater>();
  const std::span<const uint8_t> deflated = deflater->block(raw, repeats);
  const uint32_t sum = checksum == Checksum::kCrc32 ? libdeflate_crc32(0, raw.data(), raw.size())
                                                    : libdeflate_adler32(1, raw.data(), raw.size());
  return {{deflated.begin(), deflated.end()}, raw.size(), sum};
}

Status deflate_pieces(size_t count, const std::function<DeflatedPiece(size_t)>& make,
                      const std::function<Status(const DeflatedPiece&)>& take) {
  for (size_t begin = 0; begin < count; begin += kBatchPieces) {
    std::vector<DeflatedPiece> pieces(std::min(kBatchPieces, count - begin));
    ThreadPool::shared().for_each(pieces.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      pieces[i] = make(begin + i);
    });
    for (const DeflatedPiece& piece : pieces) VOXELD_TRY(take(piece));
  }
  return {};
}

Status deflate_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                      const std::function<void(size_t, std::span<uint8_t>)>& fill,
                      const Repeats& repeats, Checksum checksum,
                      const std::function<Status(const DeflatedPiece&)>& take) {
  const auto make = [&](size_t i) {
    static thread_local std::vector<uint8_t> raw;
    raw.resize(bytes_of(i));
    fill(i, raw);
    return deflate_piece(raw, repeats, checksum);
  };
  return deflate_pieces(count, make, take);
}

Status deflate_bytes(std::span<const uint8_t> raw, Checksum checksum,
                     const std::function<Status(const DeflatedPiece&)>& take) {
  const auto make = [&](size_t i) {
    const size_t begin = i * kPieceBytes;
    return deflate_piece(raw.subspan(begin, std::min(kPieceBytes, raw.size() - begin)),
                         Repeats::anywhere(), checksum);
  };
  return deflate_pieces((raw.size() + kPieceBytes - 1) / kPieceBytes, make, take);
}

}  // namespace voxeld
