// The samples of an array, made in pieces: only those at hand need memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/result.h"
#include "server/formats/zip/deflate.h"

namespace voxeld {

class OutputFile;
class ZipWriter;

class ArrayPieces {
 public:
  virtual ~ArrayPieces() = default;

  virtual size_t piece_count() const = 0;
  // The bytes before a piece; of piece_count(): all bytes of the array.
  virtual uint64_t piece_begin(size_t piece) const = 0;
  // Writes the piece's bytes. Thread-safe.
  virtual void fill(size_t piece, std::span<uint8_t> bytes) const = 0;
  // The repetitions that are worth a search.
  virtual Repeats repeats() const = 0;

  size_t piece_bytes(size_t piece) const {
    return static_cast<size_t>(piece_begin(piece + 1) - piece_begin(piece));
  }
  uint64_t bytes() const { return piece_begin(piece_count()); }

 protected:
  ArrayPieces() = default;
  ArrayPieces(const ArrayPieces&) = default;
  ArrayPieces& operator=(const ArrayPieces&) = default;
};

// Appends the samples, without a header, to a file or to the zip's member. Errors: storage-full,
// internal.
Status append_pieces(OutputFile& file, const ArrayPieces& array);
Status append_pieces(ZipWriter& zip, const ArrayPieces& array);

}  // namespace voxeld
