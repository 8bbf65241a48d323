// OKLab, a space in which the distance of colours is about as large as it looks.
#pragma once

#include <array>
#include <cstdint>

namespace voxeld {

using Lab = std::array<double, 3>;  // lightness 0..1; a and b about -0.4..0.4

// OKLab of an sRGB colour. Coefficients: Ottosson, "A perceptual color space for image processing",
// 2020.
Lab oklab(const std::array<uint8_t, 3>& srgb);

}  // namespace voxeld
