#include "proto/codec/bit_volume.h"

#include <array>

namespace voxeld {
namespace {

// Spreads 4 cells of x: bit i of the nibble goes to Morton bit 0, 1, 8 or 9 of a BrickMask word. x0
// is bit 0 of the Morton index and x1 is bit 3.
constexpr uint64_t spread_nibble(uint32_t nibble) {
  return (nibble & 3u) | static_cast<uint64_t>(nibble >> 2 & 3u) << 8;
}

// The place of row (y, z) of a brick, y and z in 0..7, in the words of its mask. `word` has its low
// x, the next word its high x.
struct RowPlace {
  size_t word = 0;
  uint32_t shift = 0;
};
constexpr RowPlace row_place(uint32_t y, uint32_t z) {
  return {(y >> 2) << 1 | (z >> 2) << 2,
          (y & 1) << 1 | (z & 1) << 2 | (y >> 1 & 1) << 4 | (z >> 1 & 1) << 5};
}

// Gathers bits 0, 2, 4, ... of 16 into 8.
constexpr uint8_t even_bits(uint32_t v) {
  v &= 0x5555u;
  v = (v | v >> 1) & 0x3333u;
  v = (v | v >> 2) & 0x0f0fu;
  return static_cast<uint8_t>(v | v >> 4);
}

}  // namespace

void set_brick(BitVolume& volume, const std::array<int, 3>& brick, const BrickMask& mask) {
  for (uint32_t z = 0; z < 8; ++z) {
    for (uint32_t y = 0; y < 8; ++y) {
      const RowPlace place = row_place(y, z);
      uint32_t bits = 0;
      for (uint32_t half = 0; half < 2; ++half) {
        const uint64_t word = mask.words[place.word + half] >> place.shift;
        bits |= static_cast<uint32_t>((word & 3) | (word >> 8 & 3) << 2) << 4 * half;
      }
      volume.row(8 * brick[1] + static_cast<int>(y), 8 * brick[2] + static_cast<int>(z))[brick[0]] =
          static_cast<uint8_t>(bits);
    }
  }
}

BrickMask brick_at(const BitVolume& volume, const std::array<int, 3>& brick) {
  BrickMask mask;
  for (uint32_t z = 0; z < 8; ++z) {
    for (uint32_t y = 0; y < 8; ++y) {
      const RowPlace place = row_place(y, z);
      const uint32_t bits = volume.row(8 * brick[1] + static_cast<int>(y),
                                       8 * brick[2] + static_cast<int>(z))[brick[0]];
      mask.words[place.word] |= spread_nibble(bits & 15) << place.shift;
      mask.words[place.word + 1] |= spread_nibble(bits >> 4) << place.shift;
    }
  }
  return mask;
}

BitVolume halved(const BitVolume& volume) {
  BitVolume half(volume.side() / 2);
  for (int z = 0; z < half.side(); ++z) {
    for (int y = 0; y < half.side(); ++y) {
      const std::array<const uint8_t*, 4> rows = {
          volume.row(2 * y, 2 * z), volume.row(2 * y + 1, 2 * z), volume.row(2 * y, 2 * z + 1),
          volume.row(2 * y + 1, 2 * z + 1)};
      uint8_t* out = half.row(y, z);
      for (size_t i = 0; i < half.row_bytes(); ++i) {
        uint32_t any = 0;
        for (const uint8_t* row : rows) any |= row_bits(row, static_cast<int>(16 * i));
        out[i] = even_bits(any | any >> 1);
      }
    }
  }
  return half;
}

}  // namespace voxeld
