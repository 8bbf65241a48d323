// The native container: a sparse grid as breadth-first octrees and attribute streams, by tile.
//
// All numbers are little-endian; every reserved byte is zero. [n] is an array of n.
//
//   byte  size  header
//      0     8  magic "VOXGRID" and a zero byte
//      8     4  u32 version, 3
//     12     4  u32 channels: bit 0 colour, 1 normal, 2 material, 3 label, 4 distance, 5 coverage
//     16    12  i32[3] dims: cells in x, y, z, each 1..16384
//     28     4  u32 tile side as a power of two: 8 (256 cells)
//     32    24  f64[3] origin: world position of the min corner of cell 0,0,0
//     56    24  f64[3] voxel size: world units, > 0
//     80     4  u32 tile count
//     84     4  u32 meta bytes
//     88     8  u64 voxel count of all tiles
//     96     8  u64 bytes of the whole container
//    104     7  u8[7] codec of the octree's stream and of each channel's, in the order of their
//               bits: 0 fast, 1 small; 0 where the grid has no such channel
//    111    17  reserved
//    128     m  meta: a JSON object in UTF-8, then zeros up to a multiple of 8
//
//   directory, for a grid of n channels: 36 + 4 n bytes per tile, rounded up to a multiple of 8, in
//   ascending Morton order of the tile's coord
//      0    12  u32[3] coord, in tiles
//     12     4  u32 brick count: occupied bricks of 8x8x8 cells that lie in no full node
//     16     8  u64 voxel count, those in full nodes included
//     24     8  u64 offset of the tile's data in the container
//     32     4  u32 octree bytes, and
//     36   4 n  u32[n] bytes of each channel that the grid has, in the order of their bits; streams
//               are stored one after the other from offset on, tiles without gaps to the end of
//               the container
//     ..     -  zeros up to the entry's size
//
// A full node is an entirely occupied node of 8 cells or more whose voxels have no attributes. The
// attribute streams hold the voxels of the other bricks. A tile without such bricks has no
// attribute streams, and their lengths are 0.
//
// Codec fast: each stream is one zstd frame with content size and checksum. Contents:
//   octree  one byte per node, breadth first: the root (256 cells), then all nodes of 128, 64, ...
//           2 cells in Morton order. Bit i of a byte: child i = x | y<<1 | z<<2 is occupied; at 2
//           cells the children are the cells. Only nodes that are not empty appear, so a level has
//           as many bytes as the level above has set bits. Byte 0: a full node (8 cells or more);
//           it has no children in the stream.
//   colour  4 planes (R, G, B as sRGB, A linear) of one byte per voxel in Morton order; each byte
//           is the difference to the one before it in its plane, modulo 256
//   normal  3 planes (x, y, z; signed, unit normal times 127) in the same way
//   material, label     2 planes (low and high byte of an id; 0: none)
//   distance            2 planes (low and high byte, signed)
//   coverage            1 plane
//
// One grid has exactly one octree. Full nodes are as large as possible: eight full siblings are
// refused. Without attributes a full brick is a full node: one that is spelled out is refused.
//
// Codec small: each stream is entropy coded with contexts: proto/README.md,
// proto/codec/octree_small.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld {

// Version 3 has channels beside colour and normal. Versions 1 and 2 were never released.
inline constexpr uint32_t kGridVersion = 3;
inline constexpr size_t kGridHeaderBytes = 128;

// Bytes of one tile's entry in the directory.
constexpr size_t grid_entry_bytes(const ChannelSet& channels) {
  return (36 + 4 * channels.count() + 7) / 8 * 8;
}

// The codec of each kind of stream.
struct StreamCodecs {
  Codec octree = Codec::kFast;
  std::array<Codec, kChannelCount> channels{};  // by number of the channel

  static StreamCodecs all(Codec codec) {
    StreamCodecs codecs{codec, {}};
    codecs.channels.fill(codec);
    return codecs;
  }
  bool operator==(const StreamCodecs&) const = default;
};

// The facts of a container about the grid as a whole.
struct GridHeader {
  std::array<int32_t, 3> dims{};       // cells
  std::array<double, 3> origin{};      // world position of the min corner of cell 0,0,0
  std::array<double, 3> voxel_size{};  // world units
  ChannelSet channels;
  StreamCodecs codecs;           // read: fast for absent channels
  std::string meta_json = "{}";  // JSON object: source, options, pipeline, units, ...
};

// Writes a whole container. Tiles must have distinct coords inside dims, in any order. They are
// stored in Morton order of coord and in canonical form, so equal grids give equal bytes. Empty
// tiles are omitted. Errors: internal for tiles that break SparseTile's rules or the header's.
Result<std::vector<uint8_t>> encode_grid(const GridHeader& header,
                                         std::span<const SparseTile> tiles);

// Reads a container. Every length is checked before memory is allocated. Hostile bytes give an
// Error of code bad-request: "grid container, byte N: ...".
class GridReader {
 public:
  // `bytes` must outlive the reader.
  static Result<GridReader> open(std::span<const uint8_t> bytes);

  const GridHeader& header() const { return header_; }
  size_t tile_count() const { return entries_.size(); }
  std::array<int32_t, 3> tile_coord(size_t index) const { return entries_[index].coord; }
  uint64_t tile_voxel_count(size_t index) const { return entries_[index].voxel_count; }
  // Bricks that lie in no full node.
  uint64_t tile_brick_count(size_t index) const { return entries_[index].brick_count; }
  uint64_t voxel_count() const { return voxel_count_; }
  // First byte and number of bytes of a tile's data in the container, for range requests.
  std::pair<uint64_t, uint64_t> tile_byte_range(size_t index) const;
  // Decodes one tile; the result is canonical.
  Result<SparseTile> decode_tile(size_t index) const;
  // Decodes all tiles on all cores, in the order of their indexes. Returns the first error, if any.
  Result<std::vector<SparseTile>> decode_tiles() const;

 private:
  struct Entry {
    std::array<int32_t, 3> coord{};
    uint64_t offset = 0, voxel_count = 0;
    uint32_t octree_bytes = 0, brick_count = 0;
    std::array<uint32_t, kChannelCount> channel_bytes{};  // 0 for absent channels

    uint64_t bytes() const;
  };
  GridReader() = default;
  Status read_header();
  Status read_codecs();
  Status read_directory(size_t directory);
  Status read_entry(size_t at, uint64_t offset);

  GridHeader header_;
  std::span<const uint8_t> bytes_;
  std::vector<Entry> entries_;
  uint64_t voxel_count_ = 0;
  size_t meta_bytes_ = 0;
  size_t tile_count_ = 0;
};

}  // namespace voxeld
