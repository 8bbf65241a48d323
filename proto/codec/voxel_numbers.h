// Maps a cell of a tile to the number of its voxel among those with attributes.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "proto/codec/sparse_tile.h"

namespace voxeld {

class VoxelNumbers {
 public:
  static constexpr uint32_t kNone = ~uint32_t{0};

  // `tile` must outlive this object and keep its bricks.
  explicit VoxelNumbers(const SparseTile& tile)
      : tile_(tile), brick_of_(size_t{1} << (3 * kTileLevels), kNone) {
    uint32_t voxels = 0;
    for (size_t b = 0; b < tile.masks.size(); ++b) {
      brick_of_[tile.brick_morton[b]] = static_cast<uint32_t>(b);
      auto& firsts = first_of_word_.emplace_back();
      for (size_t word = 0; word < firsts.size(); ++word) {
        firsts[word] = voxels;
        voxels += static_cast<uint32_t>(std::popcount(tile.masks[b].words[word]));
      }
    }
  }

  // Returns kNone for cells that are outside the tile, empty or in a full node.
  uint32_t find(int x, int y, int z) const {
    constexpr int kOutside = ~(limits::kTileSide - 1);
    if (((x | y | z) & kOutside) != 0) return kNone;
    const uint32_t morton =
        morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    const uint32_t brick = brick_of_[morton >> 9];
    if (brick == kNone) return kNone;
    const size_t word = morton >> 6 & 7;
    const uint64_t bits = tile_.masks[brick].words[word], bit = uint64_t{1} << (morton & 63);
    if ((bits & bit) == 0) return kNone;
    return first_of_word_[brick][word] + static_cast<uint32_t>(std::popcount(bits & (bit - 1)));
  }

 private:
  const SparseTile& tile_;
  std::vector<uint32_t> brick_of_;                      // by Morton code
  std::vector<std::array<uint32_t, 8>> first_of_word_;  // of each brick
};

}  // namespace voxeld
