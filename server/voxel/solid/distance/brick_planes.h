// A brick as planes of z: bit y*8 + x of word z. Rows of x are easier to sweep than Morton order.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "proto/codec/sparse_tile.h"

namespace voxeld {

using BrickPlanes = std::array<uint64_t, 8>;

namespace brick_layout {
// Bit places in a word of 4x4x4 cells in Morton order: x has index bits 0 and 3, y 1 and 4, z 2 and
// 5.
inline constexpr std::array<int, 4> kPlaceY = {0, 2, 16, 18};
inline constexpr std::array<int, 4> kPlaceZ = {0, 4, 32, 36};
constexpr uint64_t spread_x(uint64_t bits) {
  return (bits & 3) | (bits & 12) << 6;
}
constexpr uint64_t gather_x(uint64_t word) {
  return (word & 3) | (word >> 6 & 12);
}
}  // namespace brick_layout

inline BrickPlanes planes_of_brick(const BrickMask& mask) {
  BrickPlanes planes{};
  for (size_t z = 0; z < 8; ++z) {
    for (size_t y = 0; y < 8; ++y) {
      const size_t octant = (z & 4) | (y & 4) / 2;
      const int place = brick_layout::kPlaceY[y & 3] + brick_layout::kPlaceZ[z & 3];
      const uint64_t low = brick_layout::gather_x(mask.words[octant] >> place);
      const uint64_t high = brick_layout::gather_x(mask.words[octant + 1] >> place);
      planes[z] |= (low | high << 4) << (8 * y);
    }
  }
  return planes;
}

inline BrickMask brick_of_planes(const BrickPlanes& planes) {
  BrickMask mask;
  for (size_t z = 0; z < 8; ++z) {
    for (size_t y = 0; y < 8; ++y) {
      const size_t octant = (z & 4) | (y & 4) / 2;
      const int place = brick_layout::kPlaceY[y & 3] + brick_layout::kPlaceZ[z & 3];
      const uint64_t row = planes[z] >> (8 * y) & 0xff;
      mask.words[octant] |= brick_layout::spread_x(row & 15) << place;
      mask.words[octant + 1] |= brick_layout::spread_x(row >> 4) << place;
    }
  }
  return mask;
}

}  // namespace voxeld
