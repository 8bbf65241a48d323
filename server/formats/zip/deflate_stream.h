// One deflate stream with the frame of gzip (RFC 1952) or zlib (RFC 1950), deflated on all threads.
// Parts need not fit into memory or know their length in advance. The frame has no time and no
// name, so equal parts in equal pieces give equal bytes.
//
//   gzip   1f 8b 08 00, 4 zeros, 00 ff   blocks   u32 CRC-32, u32 raw length (little-endian)
//   zlib   78 01                         blocks   u32 Adler-32 (big-endian)
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/deflate.h"
#include "server/formats/zip/deflate_pieces.h"

namespace voxeld {

class DeflateStream {
 public:
  enum class Frame { kGzip, kZlib };

  // The file outlives the stream.
  DeflateStream(OutputFile& file, Frame frame);
  // Begins the stream; the first call.
  Status begin();
  // Begins a stream of zlib whose first bytes, this many, are those of finish(first). They are
  // stored, so that their place in the file is known.
  Status begin_without(size_t first_bytes);
  Status add(std::span<const uint8_t> bytes);
  // Adds `count` pieces as ZipWriter::add_pieces() does.
  Status add_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                    const std::function<void(size_t, std::span<uint8_t>)>& fill,
                    const Repeats& repeats);
  // The same of pieces whose length is known once they are made: make(i, bytes) replaces the bytes
  // by those of piece i, at most Deflater::kBlockBytesMax. Several threads call it at once.
  Status add_pieces(size_t count, const std::function<void(size_t, std::vector<uint8_t>&)>& make,
                    const Repeats& repeats);
  // Ends the stream; the last call.
  Status finish();
  // The same after begin_without().
  Status finish(std::span<const uint8_t> first);

  // Added so far, without those of begin_without().
  uint64_t raw_bytes() const { return raw_bytes_; }

 private:
  Checksum checksum() const {
    return frame_ == Frame::kGzip ? Checksum::kCrc32 : Checksum::kAdler32;
  }
  Status append(const DeflatedPiece& piece);

  OutputFile& file_;
  Frame frame_;
  uint32_t sum_;
  uint64_t raw_bytes_ = 0;
  uint64_t first_at_ = 0;  // of the stored blocks of begin_without(), in the file
};

// A zlib stream of one block, for formats whose blocks are streams of their own.
std::vector<uint8_t> zlib_stream(std::span<const uint8_t> raw, const Repeats& repeats);
// The same with the frame of gzip.
std::vector<uint8_t> gzip_stream(std::span<const uint8_t> raw, const Repeats& repeats);

}  // namespace voxeld
