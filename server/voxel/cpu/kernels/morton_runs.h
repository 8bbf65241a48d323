// Runs of cells in a tile of Morton words.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/base/simd/lanes.h"

namespace voxeld {
namespace {

// Spreads 8 bits: bit i goes to bit 3 i.
constexpr uint32_t spread8(uint32_t v) {
  v = (v | v << 8) & 0x00f00fu;
  v = (v | v << 4) & 0x0c30c3u;
  return (v | v << 2) & 0x249249u;
}

inline IntLanes spread8(IntLanes v) {
  v = (v | v << 8) & 0x00f00f;
  v = (v | v << 4) & 0x0c30c3;
  return (v | v << 2) & 0x249249;
}

// Gathers the 3 bits at places 0, 3 and 6.
constexpr uint32_t compact3(uint32_t v) {
  return (v & 1) | (v >> 2 & 2) | (v >> 4 & 4);
}

struct SpreadTable {
  uint32_t at[256];
  constexpr SpreadTable() : at{} {
    for (uint32_t i = 0; i < 256; ++i) at[i] = spread8(i);
  }
};
constexpr SpreadTable kSpread;

// Bits of a word's cells along one axis. Entry [axis][b] has the cells i for which bit i of b is
// set.
struct RunTable {
  uint64_t at[3][16];
  constexpr RunTable() : at{} {
    for (uint32_t axis = 0; axis < 3; ++axis) {
      for (uint32_t bits = 0; bits < 16; ++bits) {
        for (uint32_t i = 0; i < 4; ++i) {
          if ((bits >> i & 1) != 0) at[axis][bits] |= uint64_t{1} << (spread8(i) << axis);
        }
      }
    }
  }
};
constexpr RunTable kRun;

// Sets cells [begin, end), not empty, along `axis`. Returns the blocks that hold them.
inline uint64_t set_run(uint64_t* words, uint32_t axis, uint32_t row, uint32_t begin,
                        uint32_t end) {
  uint64_t blocks = 0;
  const uint32_t shift = row & 63;
  for (uint32_t at = begin; at < end;) {
    const uint32_t chunk = at & ~3u;
    const uint32_t stop = end < chunk + 4 ? end : chunk + 4;
    const uint32_t bits = (1u << (stop - chunk)) - (1u << (at - chunk));
    const uint32_t word = (row | kSpread.at[chunk] << axis) >> 6;
    words[word] |= kRun.at[axis][bits] << shift;
    blocks |= uint64_t{1} << (word >> 12);
    at = stop;
  }
  return blocks;
}

// Blocks of 64^3 cells that the box of cells reaches.
inline uint64_t blocks_of(Int4 first, Int4 last) {
  uint64_t blocks = 0;
  first >>= 6;
  last >>= 6;
  for (int z = first[2]; z <= last[2]; ++z) {
    for (int y = first[1]; y <= last[1]; ++y) {
      for (int x = first[0]; x <= last[0]; ++x) {
        blocks |= uint64_t{1} << (kSpread.at[x] | kSpread.at[y] << 1 | kSpread.at[z] << 2);
      }
    }
  }
  return blocks;
}

}  // namespace
}  // namespace voxeld
