// The cells of a grid's tiles by bricks, and changes of them.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/voxel/solid/regions.h"

namespace voxeld {

// The number of cells.
uint64_t count_of(const BrickMask& mask);
// Cells of a tile's brick, by its Morton index.
BrickMask brick_of(const SparseTile& tile, uint32_t morton);

// Tiles have no attributes. Changes show once finish() has applied them. Not thread-safe.
class InsideCells {
 public:
  // The tiles, canonical and in any order, and regions of the same grid, by which they are
  // numbered. Both must outlive this object.
  InsideCells(std::vector<SparseTile>& tiles, const Regions& regions);

  // Cells of a brick, by its tile's number and its Morton index there, and the number of a tile's.
  BrickMask brick(size_t tile, uint32_t morton) const;
  uint64_t count(size_t tile) const;

  void change(size_t tile, uint32_t morton, const BrickMask& cells, bool inside);
  // All cells of a tile, which has no other changes.
  void change_tile(size_t tile, bool inside);
  // Applies the changes and drops tiles without cells. This object is of no use then.
  void finish();

 private:
  static constexpr uint32_t kNone = UINT32_MAX;
  struct Change {
    uint32_t morton;
    bool inside;
    BrickMask cells;
  };

  // Adds the tile if there is none.
  SparseTile& tile_of(size_t number);
  static void apply(const std::vector<Change>& changes, std::vector<BrickMask>& bricks,
                    SparseTile& tile);

  std::vector<SparseTile>& tiles_;
  const Regions& regions_;
  std::vector<uint32_t> places_;              // index into tiles_, by the tile's number
  std::vector<std::vector<Change>> changes_;  // by the tile's number
};

}  // namespace voxeld
