// The shader's own text, compiled as C++, against the layout that proto/codec/sparse_tile.h
// defines.
#include <gtest/gtest.h>

#include "proto/codec/sparse_tile.h"

namespace voxeld {
namespace glsl {
#include "shaders/raymarch/dda_brick.glsl"
}  // namespace glsl

TEST(DdaBrick, bits_stand_in_morton_order) {
  for (uint32_t z = 0; z < 16; ++z) {
    for (uint32_t y = 0; y < 16; ++y) {
      for (uint32_t x = 0; x < 16; ++x) {
        EXPECT_EQ(static_cast<uint32_t>(glsl::dda_brick_bit(
                      static_cast<int>(x), static_cast<int>(y), static_cast<int>(z))),
                  morton_encode(x % 8, y % 8, z % 8));
      }
    }
  }
}

}  // namespace voxeld
