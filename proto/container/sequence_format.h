// The native container of a whole sequence. The tiles of its frames are the streams of the grid
// container (proto/container/grid_format.h). Each stream is stored once, and as a difference if
// that is smaller.
//
// All numbers are little-endian; every reserved byte and all padding is zero. [n] is an array of n.
//
//   byte  size  header
//      0     8  magic "VOXSEQ" and two zero bytes
//      8     4  u32 version, 1
//     12    68  channels, dims, tile side, origin and voxel size as in the grid container; all
//               frames have the same
//     80     4  u32 frame count, 1..4096
//     84     4  u32 meta bytes
//     88     8  f64 frames per second; 0: at times of their own
//     96     8  u64 bytes of the whole container
//    104     7  u8[7] codecs as in the grid container
//    111     1  reserved
//    112     8  u64 offset of the index, a multiple of 8
//    120     4  u32 tile count, of all frames that differ
//    124     4  u32 stream count
//    128     m  meta: a JSON object in UTF-8, then zeros up to a multiple of 8
//     ..     -  the streams one after the other, then zeros up to a multiple of 8
//
//   index, to the end of the container
//     frames, 24 bytes each
//      0     8  f64 time in seconds; no frame's is before the last one's
//      8     8  u64 voxel count
//     16     4  u32 its first tile: the one after those of the frames before it, or, where an
//               earlier frame has the same tiles, that frame's first
//     20     4  u32 how many tiles
//     tiles of a grid of n channels, 28 + 4 n bytes each, rounded up to a multiple of 8; those of a
//     frame in ascending Morton order of coord
//      0    12  u32[3] coord, in tiles
//     12     4  u32 brick count, and
//     16     8  u64 voxel count, as in the grid container
//     24     4  u32 number of the octree's stream, and
//     28   4 n  u32[n] numbers of the channels' streams, 2^32 - 1 where the tile has no bricks.
//               A number is one that a tile before has for the same kind of stream, or the lowest
//               that is new
//     ..     -  zeros up to the entry's size
//     streams, 16 bytes each
//      0     8  u64 offset in the container
//      8     4  u32 bytes, 1 or more
//     12     4  u32 number of the stream that it is a difference to, a lower one and of the same
//               kind; 2^32 - 1: none. At most 8 streams are read for one: itself, the one it is a
//               difference to, and so on
//
// A stream has the bytes that it would have in the grid container of its frame, with one exception:
// a difference, which only codec fast has, is a zstd frame (with content size and checksum) whose
// raw-content dictionary ("prefix") is the contents of the other stream.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/container/grid_format.h"
#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld {

inline constexpr uint32_t kSequenceVersion = 1;
inline constexpr size_t kSequenceHeaderBytes = 128;
// Streams that are read to decode one: itself and the chain of those it is a difference to.
inline constexpr uint32_t kStreamChainMax = 8;

// Contents of streams by their number, kept from the frame that was read last.
using RawStreams = std::map<uint32_t, std::shared_ptr<const std::vector<uint8_t>>>;

// Reads a container. Every length is checked before memory is allocated. Hostile bytes give an
// Error of code bad-request: "sequence container, byte N: ...".
class SequenceReader {
 public:
  // `bytes` must outlive the reader.
  static Result<SequenceReader> open(std::span<const uint8_t> bytes);

  // The header of every frame, with the sequence's meta.
  const GridHeader& header() const { return header_; }
  double fps() const { return fps_; }
  size_t frame_count() const { return frames_.size(); }
  double time_s(size_t frame) const { return frames_[frame].time_s; }
  uint64_t voxel_count(size_t frame) const { return frames_[frame].voxel_count; }
  size_t tile_count(size_t frame) const { return frames_[frame].tile_count; }
  // Whether both frames have the same tiles, judged by the index alone.
  bool same_tiles(size_t frame, size_t other) const;
  // Decodes the tiles of one frame on all cores; they are canonical. Of other frames it reads only
  // the streams that the frame's own are differences to. `kept` holds streams that need not be read
  // again. It begins empty, and the frame's streams replace its contents. Frames read in order then
  // apply each difference once.
  Result<std::vector<SparseTile>> decode_frame(size_t frame, RawStreams* kept = nullptr) const;

  // Statistics of how the container was written, for measurements.
  size_t stream_count() const { return streams_.size(); }
  // Streams that are read for this one, itself included: 1..kStreamChainMax.
  uint32_t chain_length(size_t stream) const { return streams_[stream].chain; }

 private:
  struct Frame {
    double time_s = 0;
    uint64_t voxel_count = 0;
    uint32_t first_tile = 0, tile_count = 0;
  };
  struct Tile {
    std::array<int32_t, 3> coord{};
    uint32_t brick_count = 0;
    uint64_t voxel_count = 0;
    // By kind: 0 the octree, 1 + the number of a channel.
    std::array<uint32_t, 1 + kChannelCount> streams{};
  };
  struct Stream {
    uint64_t offset = 0;
    uint32_t bytes = 0, base = 0;
    uint32_t chain = 1;
    size_t kind = 0;
    size_t raw_max = 0;  // bytes of its contents
  };
  SequenceReader() = default;
  Status read_header();
  Status read_codecs();
  Status read_meta(size_t meta_bytes);
  Status read_index(uint64_t index);
  Status read_frames(size_t at, size_t count);
  Status read_frame(size_t at, uint32_t& next_tile);
  Status read_tiles(size_t at, size_t count);
  Result<Tile> read_tile(size_t at);
  Status note_stream(size_t at, size_t kind, const Tile& tile);
  Status check_frame(size_t at, size_t tiles_at) const;
  Status read_streams(size_t at, size_t count, uint64_t end);
  Status read_stream(size_t at, size_t number, uint64_t offset);

  bool is_small(size_t kind) const;
  std::span<const uint8_t> stored(const Stream& stream) const;
  Result<std::shared_ptr<const std::vector<uint8_t>>> raw_stream(uint32_t number,
                                                                 const RawStreams* kept) const;
  Result<RawStreams> raw_streams(std::span<const Tile> tiles, const RawStreams* kept) const;
  Result<SparseTile> decode_tile(const Tile& entry, const RawStreams& raw) const;
  Status decode_octree(const Tile& entry, const RawStreams& raw, SparseTile& tile) const;
  Status decode_channel(const Tile& entry, size_t kind, const RawStreams& raw,
                        SparseTile& tile) const;

  GridHeader header_;
  double fps_ = 0;
  std::span<const uint8_t> bytes_;
  std::vector<Frame> frames_;
  std::vector<Tile> tiles_;
  std::vector<Stream> streams_;
};

}  // namespace voxeld
