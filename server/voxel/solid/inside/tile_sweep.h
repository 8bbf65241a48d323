// Parity along one or three axes for all cells of a tile. Crossings toggle single bits; prefix sums
// over XOR of whole words then give the parity. Eisemann & Decoret 2008, "Single-pass GPU solid
// voxelization for real-time applications", instead flip a whole column of bits per fragment.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "server/voxel/solid/inside/crossings.h"
#include "server/voxel/solid/inside/tile_bits.h"

namespace voxeld {

// The part of a tile to sweep: rows of bricks brick_y_first to brick_y_end, and the first `size`
// cells, which are inside the grid.
struct TileExtent {
  std::array<int, 3> size{limits::kTileSide, limits::kTileSide, limits::kTileSide};
  int brick_y_first = 0, brick_y_end = kTileBricks;

  int bricks_z() const { return (size[2] + limits::kBrickSide - 1) / limits::kBrickSide; }
};

// Parity of columns along z, carried from tile to tile upwards.
class SweepZ {
 public:
  void begin_column() { carry_.fill(0); }
  // The state that all columns share: 0 outside, 1 inside; -1 if they differ.
  int uniform() const;
  // v_offset: y in the tile of the crossings' v = 0. base: the tile's first cell along z.
  void toggle(std::span<const Crossing> crossings, int v_offset, int base);
  // Parity of one row of bricks. For each y, rows must be taken in ascending order of z.
  void next_row(int brick_y, int brick_z, BrickRow& rows);

 private:
  ToggleVolume volume_;
  std::array<uint64_t, kTileBricks * kBlockPlaneWords> carry_{};  // y, then words of x
};

// Parity of columns along x, for one tile.
class SweepX {
 public:
  // Takes the crossings of the tile's column, those below the tile and those in it. u is y, v is z.
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
  // For each z, rows must be taken in ascending order of y.
  void next_row(int brick_y, int brick_z, BrickRow& rows);

 private:
  ToggleVolume volume_;
  std::array<uint64_t, limits::kTileSide * kBlockRowWords> carry_{};  // z, then words of x
};

// Clears the cells outside the grid.
void trim(const TileExtent& extent, int brick_y, int brick_z, BrickRow& rows);

}  // namespace voxeld
