// The cells of a tile row by row, as sweeps make them, and their conversion to bricks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/huge_array.h"
#include "server/voxel/solid/inside/crossings.h"

namespace voxeld {

// Bricks along a side of a tile.
inline constexpr int kTileBricks = limits::kTileSide / limits::kBrickSide;
inline constexpr size_t kTileBrickCount = size_t{kTileBricks} * kTileBricks * kTileBricks;

// The 32 bricks of a row along x. Word (z*8 + y)*4 + x/64, bit x%64; z and y are within the brick.
inline constexpr size_t kBlockRowWords = limits::kTileSide / 64;
inline constexpr size_t kRowBytes = limits::kTileSide / 8;
inline constexpr size_t kBlockPlaneWords = limits::kBrickSide * kBlockRowWords;
inline constexpr size_t kBrickRowWords = limits::kBrickSide * kBlockPlaneWords;
using BrickRow = std::array<uint64_t, kBrickRowWords>;

// Brick number brick_x of the row.
BrickMask brick_of_row(const BrickRow& rows, int brick_x);

// Bits of a tile that start at 0 and are toggled one by one. They are stored as brick rows of 2
// KiB; 2 MiB in all.
class ToggleVolume {
 public:
  ToggleVolume() : words_(kTileBrickCount / kTileBricks * kBrickRowWords) {}

  void toggle(uint32_t x, uint32_t y, uint32_t z) {
    const size_t row = size_t{z >> 3} * kTileBricks + (y >> 3);
    used_[row] = true;
    words_.data()[row * kBrickRowWords + ((z & 7) * 8 + (y & 7)) * kBlockRowWords + (x >> 6)] ^=
        uint64_t{1} << (x & 63);
  }
  bool used(size_t row) const { return used_[row]; }
  const uint64_t* row(size_t row) const { return words_.data() + row * kBrickRowWords; }
  // Resets a row to 0. Cheap if nothing was toggled in it.
  void clear(size_t row);

 private:
  HugeArray words_;
  std::array<bool, size_t{kTileBricks} * kTileBricks> used_{};  // index: z/8 * 32 + y/8
};

// The bricks of a tile, added in any order of rows. Several threads may add rows if each has its
// own lane.
class TileBits {
 public:
  // lanes: 1 to 255.
  explicit TileBits(size_t lanes = 1) : lanes_(lanes) {}

  void add_row(size_t lane, int brick_y, int brick_z, const BrickRow& rows);
  // Appends the bricks, canonical, to `tile` and empties this object.
  void move_to(SparseTile& tile);

 private:
  enum State : uint8_t { kEmpty, kFull, kMixed };

  struct alignas(64) Lane {
    std::vector<BrickMask> masks;
    bool used = false;
  };
  std::vector<Lane> lanes_;
  // Indexed by the brick's Morton index. places_ of a mixed brick: the lane in 8 bits and the mask
  // in 24.
  std::vector<uint8_t> states_ = std::vector<uint8_t>(kTileBrickCount);
  std::vector<uint32_t> places_ = std::vector<uint32_t>(kTileBrickCount);
};

}  // namespace voxeld
