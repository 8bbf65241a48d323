// Means of colours and normals, in the form that the ray march reads. Cubes of voxels that are
// drawn as one use them.
#pragma once

#include <cstdint>
#include <span>

namespace voxeld {

// x | y << 8 | z << 16, signed bytes.
constexpr uint32_t pack_normal(int8_t x, int8_t y, int8_t z) {
  return uint32_t{static_cast<uint8_t>(x)} | uint32_t{static_cast<uint8_t>(y)} << 8 |
         uint32_t{static_cast<uint8_t>(z)} << 16;
}

// The mean of sRGB words R | G << 8 | B << 16 | A << 24, taken in linear light and opaque. Words of
// alpha 0 count only if there are no others; then the mean has alpha 0. 0 if `colors` is empty.
uint32_t mean_color(std::span<const uint32_t> colors);

// The median luminance (Rec. 709) of such words in linear light, 0..1, of at most some 100,000 of
// them, without those of alpha 0; 1 if none is left.
double median_luminance(std::span<const uint32_t> colors);

// The mean of packed normals. It is shorter than 127 if they point in different directions.
uint32_t mean_normal(std::span<const uint32_t> normals);

}  // namespace voxeld
