#include "proto/codec/bit_volume.h"

#include <gtest/gtest.h>

#include <random>

namespace voxeld {
namespace {

TEST(BitVolume, a_brick_is_read_as_it_was_written) {
  std::mt19937_64 random(1);
  BitVolume volume(32);
  std::array<BrickMask, 64> masks;
  for (uint32_t b = 0; b < 64; ++b) {
    for (uint64_t& word : masks[b].words) word = random();
    const auto at = morton_decode(b);
    set_brick(volume, {static_cast<int>(at[0]), static_cast<int>(at[1]), static_cast<int>(at[2])},
              masks[b]);
  }
  for (uint32_t b = 0; b < 64; ++b) {
    const auto at = morton_decode(b);
    const std::array<int, 3> brick = {static_cast<int>(at[0]), static_cast<int>(at[1]),
                                      static_cast<int>(at[2])};
    EXPECT_EQ(brick_at(volume, brick), masks[b]) << b;
    for (uint32_t i = 0; i < 512; ++i) {
      const auto cell = morton_decode(i);
      ASSERT_EQ(volume.get(8 * brick[0] + static_cast<int>(cell[0]),
                           8 * brick[1] + static_cast<int>(cell[1]),
                           8 * brick[2] + static_cast<int>(cell[2])),
                (masks[b].words[i / 64] >> (i % 64) & 1) != 0)
          << b << " " << i;
    }
  }
}

TEST(BitVolume, a_half_has_a_cell_where_one_of_eight_is) {
  for (const int side : {2, 4, 8, 16, 64}) {
    std::mt19937 random(static_cast<uint32_t>(side));
    BitVolume volume(side);
    for (int i = 0; i < side * side; ++i) {
      const auto below = [&] { return static_cast<int>(random() % static_cast<uint32_t>(side)); };
      const int x = below(), y = below(), z = below();
      volume.set(x, y, z);
    }
    const BitVolume half = halved(volume);
    for (int z = 0; z < side / 2; ++z) {
      for (int y = 0; y < side / 2; ++y) {
        for (int x = 0; x < side / 2; ++x) {
          bool any = false;
          for (int i = 0; i < 8; ++i) {
            any |= volume.get(2 * x + (i & 1), 2 * y + (i >> 1 & 1), 2 * z + (i >> 2));
          }
          ASSERT_EQ(half.get(x, y, z), any) << side << ": " << x << " " << y << " " << z;
        }
      }
    }
  }
}

TEST(BitVolume, the_margin_is_empty) {
  BitVolume volume(8);
  for (int i = 0; i < 512; ++i) volume.set(i & 7, i >> 3 & 7, i >> 6);
  for (int z = -2; z < 10; ++z) {
    for (int y = -2; y < 10; ++y) {
      const bool inside = z >= 0 && z < 8 && y >= 0 && y < 8;
      EXPECT_EQ(row_bits(volume.row(y, z), -2) & 0x1fff, inside ? 0x3fcu : 0u) << y << " " << z;
    }
  }
}

}  // namespace
}  // namespace voxeld
