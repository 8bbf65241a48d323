// Writes the native container tile by tile, for grids that need not be in memory at once: tiles are
// encoded, in any thread; their bytes are stored one after the other in ascending Morton order of
// coord; and when all are there, header, meta and directory are known, which stand before them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/grid_format.h"
#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

struct EncodedTile {
  std::array<int32_t, 3> coord{};  // in tiles
  uint64_t bricks = 0, voxels = 0;
  std::vector<uint8_t> octree;                                 // its stream
  std::array<std::vector<uint8_t>, kChannelCount> channels{};  // empty where there are none

  size_t bytes() const;
  // Appends all streams, in the order of the container.
  void append_to(std::vector<uint8_t>& out) const;
};

// Whether a tile can be written: internal, for one that breaks SparseTile's rules or the header's.
Status check_tile(const SparseTile& tile, const GridHeader& header);

// The canonical form of a tile that is not empty, as the header's channels and codecs say. Errors:
// internal, for tiles that break SparseTile's rules or the header's.
Result<EncodedTile> encode_tile(const SparseTile& tile, const GridHeader& header);

// The same for many, on all cores; empty tiles are left out.
Result<std::vector<EncodedTile>> encode_tiles(std::span<const SparseTile> tiles,
                                              const GridHeader& header);

// Tile `index` of the container in `bytes`, which `reader` reads, as it stands there: for another
// container of the same channels and codecs.
EncodedTile encoded_tile(std::span<const uint8_t> bytes, const GridReader& reader, size_t index);

class GridWriter {
 public:
  // Errors: internal, for a header that no container can have.
  static Result<GridWriter> open(GridHeader header);

  const GridHeader& header() const { return header_; }
  // Takes note of the next tile; its streams follow those of the last one. Errors: internal, when
  // its coord is not after the last one's.
  Status add(const EncodedTile& tile);
  size_t tile_count() const { return entries_.size(); }
  uint64_t voxel_count() const { return voxels_; }
  // What stands before the tiles' bytes. Replaces the header's meta.
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
