// A set of bricks (8x8x8 cells) that can be anywhere, numbered tile by tile, and in a tile by z, y
// and x. Neighbours are found across tiles in constant time.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/limits.h"

namespace voxeld::mesh {

inline constexpr int kTileBricks = limits::kTileSide / limits::kBrickSide;  // on a side
inline constexpr uint32_t kNone = UINT32_MAX;

// The bricks of a tile: bit x of row z * kTileBricks + y.
using BrickRows = std::array<uint32_t, size_t{kTileBricks} * kTileBricks>;
static_assert(kTileBricks == 32);

inline size_t row_of(int y, int z) {
  return static_cast<size_t>(z) * kTileBricks + static_cast<size_t>(y);
}

// A brick of a tile, or of a tile beside it.
struct BrickPlace {
  uint32_t tile;  // kNone: there is no such tile
  int x, y, z;    // bricks from the tile's first one, 0..31
};

class BrickIndex {
 public:
  struct Tile {
    std::array<int32_t, 3> coord{};  // in tiles
    BrickRows rows{};
    std::array<uint16_t, std::tuple_size_v<BrickRows>> before{};  // bricks of the tile before a row
    uint32_t first = 0;                                           // number of its first brick
    std::array<uint32_t, 27> around{};  // by x + 1, then y + 1, z + 1; kNone: no such tile
  };

  // Tiles without bricks, in ascending Morton order. Rows are set by the caller, then numbered.
  explicit BrickIndex(std::vector<std::array<int32_t, 3>> coords);
  BrickRows& rows(size_t tile) { return tiles_[tile].rows; }
  void number_bricks();

  const std::vector<Tile>& tiles() const { return tiles_; }
  uint32_t size() const { return size_; }                         // bricks of all tiles
  uint32_t find_tile(const std::array<int32_t, 3>& coord) const;  // or kNone

  // The place of a brick that is counted from the first of `tile`, on each axis -1..32.
  BrickPlace place(size_t tile, int x, int y, int z) const;
  // Its number, or kNone.
  uint32_t find(const BrickPlace& place) const {
    if (place.tile == kNone) return kNone;
    const Tile& tile = tiles_[place.tile];
    const size_t row = row_of(place.y, place.z);
    const uint32_t bit = uint32_t{1} << place.x;
    if ((tile.rows[row] & bit) == 0) return kNone;
    return tile.first + tile.before[row] +
           static_cast<uint32_t>(std::popcount(tile.rows[row] & (bit - 1)));
  }
  uint32_t find(size_t tile, int x, int y, int z) const { return find(place(tile, x, y, z)); }

 private:
  std::vector<Tile> tiles_;
  uint32_t size_ = 0;
};

// Calls visit(x, y, z) for the bricks of a tile in the order of their numbers.
template <typename Visit>
void for_each_brick_of(const BrickRows& rows, Visit&& visit) {
  for (size_t row = 0; row < rows.size(); ++row) {
    for (uint32_t bits = rows[row]; bits != 0; bits &= bits - 1) {
      visit(std::countr_zero(bits), static_cast<int>(row % kTileBricks),
            static_cast<int>(row / kTileBricks));
    }
  }
}

}  // namespace voxeld::mesh
