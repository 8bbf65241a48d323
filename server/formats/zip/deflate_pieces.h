// Pieces of bytes that all threads make and deflate, for archives and streams.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "proto/result.h"
#include "server/formats/zip/deflate.h"

namespace voxeld {

enum class Checksum { kCrc32, kAdler32 };

struct DeflatedPiece {
  std::vector<uint8_t> deflated;  // whole blocks, without the end of a stream
  size_t raw_bytes = 0;
  uint32_t checksum = 0;  // of the raw bytes
};

// raw: at most Deflater::kBlockBytesMax bytes. Thread-safe.
DeflatedPiece deflate_piece(std::span<const uint8_t> raw, const Repeats& repeats,
                            Checksum checksum);

// Calls make(i) for i < count on all threads, some pieces at a time, and take(piece) for each in
// order. Errors: those of take.
Status deflate_pieces(size_t count, const std::function<DeflatedPiece(size_t)>& make,
                      const std::function<Status(const DeflatedPiece&)>& take);
// The same for pieces of bytes_of(i) bytes, which fill(i, bytes) writes; several threads call it at
// once.
Status deflate_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                      const std::function<void(size_t, std::span<uint8_t>)>& fill,
                      const Repeats& repeats, Checksum checksum,
                      const std::function<Status(const DeflatedPiece&)>& take);
// The same for bytes that are in memory.
Status deflate_bytes(std::span<const uint8_t> raw, Checksum checksum,
                     const std::function<Status(const DeflatedPiece&)>& take);

}  // namespace voxeld
