// Means of colours and normals in the form that the ray march reads, for cubes of voxels that are
// drawn as one.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// x | y << 8 | z << 16, signed bytes.
constexpr uint32_t pack_normal(int8_t x, int8_t y, int8_t z) {
  return uint32_t{static_cast<uint8_t>(x)} | uint32_t{static_cast<uint8_t>(y)} << 8 |
         uint32_t{static_cast<uint8_t>(z)} << 16;
}

// sRGB words R | G << 8 | B << 16 | A << 24; the mean is taken in linear light and is opaque. 0
// where there are none.
uint32_t mean_color(std::span<const uint32_t> colors);

// Of packed normals; shorter than 127 where they point in different directions.
uint32_t mean_normal(std::span<const uint32_t> normals);

}  // namespace voxeld
