// One tile of a sparse grid as plain data: what the voxelizer makes, the container stores, the
// renderer draws and the client decodes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/limits.h"

namespace voxeld {

// 8x8x8 voxels. Bit i of the 512 (bit i%64 of word i/64) is the voxel whose Morton index in the
// brick is i: i = spread(x) | spread(y)<<1 | spread(z)<<2 with x, y, z in 0..7. So byte j of the
// mask is the child mask of the j-th 2x2x2 node in Morton order, and the octree's lowest level is
// the masks themselves.
//
//   word  7      6      5      4      3      2      1      0
//        z4..7  z4..7  z4..7  z4..7  z0..3  z0..3  z0..3  z0..3
//        y4..7  y4..7  y0..3  y0..3  y4..7  y4..7  y0..3  y0..3
//        x4..7  x0..3  x4..7  x0..3  x4..7  x0..3  x4..7  x0..3
struct BrickMask {
  std::array<uint64_t, 8> words{};
  bool operator==(const BrickMask&) const = default;
};

// A cube of kTileSide^3 voxels at cell coord*kTileSide of the grid. Only occupied bricks are kept,
// in ascending Morton order of their position in the tile, so voxels in storage order are in Morton
// order of the tile. Attributes are stored for occupied voxels alone, in that order.
struct SparseTile {
  std::array<int32_t, 3> coord{};      // in tiles
  std::vector<uint32_t> brick_morton;  // ascending; < (kTileSide/kBrickSide)^3
  std::vector<BrickMask> masks;        // same length
  std::vector<uint8_t> color;          // empty, or 4 per voxel: sRGB R, G, B and linear A
  std::vector<int8_t> normal;          // empty, or 3 per voxel: unit normal times 127, rounded

  size_t voxel_count() const;
  bool operator==(const SparseTile&) const = default;
};

// Interleaves the low 10 bits of each coordinate, x lowest.
constexpr uint32_t morton_spread(uint32_t v) {
  v &= 0x3ffu;
  v = (v | (v << 16)) & 0x030000ffu;
  v = (v | (v << 8)) & 0x0300f00fu;
  v = (v | (v << 4)) & 0x030c30c3u;
  v = (v | (v << 2)) & 0x09249249u;
  return v;
}
constexpr uint32_t morton_encode(uint32_t x, uint32_t y, uint32_t z) {
  return morton_spread(x) | (morton_spread(y) << 1) | (morton_spread(z) << 2);
}
constexpr uint32_t morton_compact(uint32_t v) {
  v &= 0x09249249u;
  v = (v | (v >> 2)) & 0x030c30c3u;
  v = (v | (v >> 4)) & 0x0300f00fu;
  v = (v | (v >> 8)) & 0x030000ffu;
  v = (v | (v >> 16)) & 0x3ffu;
  return v;
}
constexpr std::array<uint32_t, 3> morton_decode(uint32_t m) {
  return {morton_compact(m), morton_compact(m >> 1), morton_compact(m >> 2)};
}

// Calls visit(brick_index, x, y, z, voxel_index) for every occupied voxel in storage order; x, y, z
// are cells of the grid, voxel_index counts within the tile.
template <typename Visit>
void for_each_voxel(const SparseTile& tile, Visit&& visit) {
  size_t voxel_index = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    const auto brick = morton_decode(tile.brick_morton[b]);
    const std::array<int32_t, 3> base = {
        tile.coord[0] * limits::kTileSide + static_cast<int32_t>(brick[0]) * limits::kBrickSide,
        tile.coord[1] * limits::kTileSide + static_cast<int32_t>(brick[1]) * limits::kBrickSide,
        tile.coord[2] * limits::kTileSide + static_cast<int32_t>(brick[2]) * limits::kBrickSide};
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t bits = tile.masks[b].words[word]; bits != 0; bits &= bits - 1) {
        const uint32_t bit = static_cast<uint32_t>(__builtin_ctzll(bits));
        const auto cell = morton_decode(word * 64 + bit);
        visit(b, base[0] + static_cast<int32_t>(cell[0]), base[1] + static_cast<int32_t>(cell[1]),
              base[2] + static_cast<int32_t>(cell[2]), voxel_index++);
      }
    }
  }
}

}  // namespace voxeld
