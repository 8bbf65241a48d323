// The mask of a tile: one bit per cell in Morton order, the order of a brick in
// proto/codec/sparse_tile.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/limits.h"

namespace voxeld {

inline constexpr size_t kTileMaskBytes =
    size_t{limits::kTileSide} * limits::kTileSide * limits::kTileSide / 8;
inline constexpr size_t kTileMaskWords = kTileMaskBytes / 4;
// Words of a block of 64^3 cells, which is a contiguous part of the mask.
inline constexpr size_t kBlockMaskWords = kTileMaskWords / 64;

// Calls visit(first_word, word_count) for each maximal run of set blocks.
template <typename Visit>
void for_each_block_run(uint64_t blocks, const Visit& visit) {
  for (size_t block = 0; block < 64;) {
    if ((blocks >> block & 1) == 0) {
      ++block;
      continue;
    }
    size_t end = block;
    while (end < 64 && (blocks >> end & 1) != 0) ++end;
    visit(block * kBlockMaskWords, (end - block) * kBlockMaskWords);
    block = end;
  }
}

}  // namespace voxeld
