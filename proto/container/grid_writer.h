// A writer of the native container, tile by tile, for grids that do not fit in memory. Tiles are
// encoded in any thread; their bytes are stored in ascending Morton order of coord. Header, meta
// and directory stand before the tiles, but are known only after the last one.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/container/grid_format.h"
#include "proto/result.h"

namespace voxeld {

struct EncodedTile {
  std::array<int32_t, 3> coord{};  // in tiles
  uint64_t bricks = 0, voxels = 0;
  std::vector<uint8_t> octree;                                 // its stream
  std::array<std::vector<uint8_t>, kChannelCount> channels{};  // empty for absent channels

  size_t bytes() const;
  // Appends all streams, in the order of the container.
  void append_to(std::vector<uint8_t>& out) const;
};

// Checks that a tile can be written. Errors: internal if it breaks SparseTile's rules or the
// header's.
Status check_tile(const SparseTile& tile, const GridHeader& header);

// Encodes the canonical form of a tile that is not empty, with the header's channels and codecs.
// Errors: internal for tiles that break SparseTile's rules or the header's.
Result<EncodedTile> encode_tile(const SparseTile& tile, const GridHeader& header);

// Encodes many tiles on all cores; empty tiles are omitted.
Result<std::vector<EncodedTile>> encode_tiles(std::span<const SparseTile> tiles,
                                              const GridHeader& header);

// Copies tile `index` of the container in `bytes`, which `reader` reads, without decoding it. The
// copy fits another container of the same channels and codecs.
EncodedTile encoded_tile(std::span<const uint8_t> bytes, const GridReader& reader, size_t index);

class GridWriter {
 public:
  // Errors: internal for a header that no container can have.
  static Result<GridWriter> open(GridHeader header);

  const GridHeader& header() const { return header_; }
  // Records the next tile; its streams follow those of the last one. Errors: internal if its coord
  // is not after the last one's.
  Status add(const EncodedTile& tile);
  size_t tile_count() const { return entries_.size(); }
  uint64_t voxel_count() const { return voxels_; }
  // The bytes that stand before the tiles. Replaces the header's meta.
  Result<std::vector<uint8_t>> finish(std::string meta_json);

 private:
  struct Entry {
    std::array<int32_t, 3> coord{};
    uint64_t voxels = 0;
    uint32_t bricks = 0, octree_bytes = 0;
    std::array<uint32_t, kChannelCount> channel_bytes{};
    uint64_t bytes = 0;
  };
  explicit GridWriter(GridHeader header) : header_(std::move(header)) {}

  GridHeader header_;
  std::vector<Entry> entries_;
  uint64_t voxels_ = 0;
};

}  // namespace voxeld
