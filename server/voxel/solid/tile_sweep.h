// Parity along one or three axes for all cells of a tile: toggles as bits, and prefix sums over XOR
// of whole words (Eisemann & Decoret 2008, "Single-pass GPU solid voxelization for real-time
// applications"; there a fragment flips a column of bits, here a bit, and a pass over the words
// does the rest).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "server/voxel/solid/crossings.h"
#include "server/voxel/solid/tile_bits.h"

namespace voxeld {

// Rows y_first to y_end of bricks in a tile whose first `size` cells lie in the grid.
struct TileExtent {
  std::array<int, 3> size{limits::kTileSide, limits::kTileSide, limits::kTileSide};
  int brick_y_first = 0, brick_y_end = kTileBricks;

  int bricks_z() const { return (size[2] + limits::kBrickSide - 1) / limits::kBrickSide; }
};

// Parity of columns along z, from tile to tile upwards.
class SweepZ {
 public:
  void begin_column() { carry_.fill(0); }
  // The state of all columns is the same, all outside (0) or all inside (1); -1 where not.
  int uniform() const;
  // `v_offset`: y in the tile of the crossings' v = 0. `base`: the tile's first cell along z.
  void toggle(std::span<const Crossing> crossings, int v_offset, int base);
  // Parity of one row of bricks; rows are taken in ascending order of z for each y.
  void next_row(int brick_y, int brick_z, BrickRow& rows);

 private:
  ToggleVolume volume_;
  std::array<uint64_t, kTileBricks * kBlockPlaneWords> carry_{};  // y, then words of x
};

// Parity of columns along x, for one tile.
class SweepX {
 public:
  // Of the tile's column: crossings below the tile, and in it. u is y, v is z.
  void begin_tile(std::span<const Crossing> below, std::span<const Crossing> in_tile, int base);
  void next_row(int brick_y, int brick_z, BrickRow& rows);

 private:
  ToggleVolume volume_;
  std::array<uint8_t, size_t{limits::kTileSide} * limits::kTileSide> entry_{};  // z, then y: 0 or 1
};

// Parity of columns along y, for one tile.
class SweepY {
 public:
  // u is z, v is x.
  void begin_tile(std::span<const Crossing> below, std::span<const Crossing> in_tile, int base);
  // Rows are taken in ascending order of y for each z.
  void next_row(int brick_y, int brick_z, BrickRow& rows);

 private:
  ToggleVolume volume_;
  std::array<uint64_t, limits::kTileSide * kBlockRowWords> carry_{};  // z, then words of x
};

// Clears the cells beyond the grid.
void trim(const TileExtent& extent, int brick_y, int brick_z, BrickRow& rows);

}  // namespace voxeld
