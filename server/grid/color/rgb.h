// sRGB colours of voxels, and their keys in tables.
#pragma once

#include <array>
#include <cstdint>

namespace voxeld {

using Rgb = std::array<uint8_t, 3>;

// The key of a colour: R | G << 8 | B << 16.
constexpr Rgb rgb_of(uint32_t key) {
  return {static_cast<uint8_t>(key), static_cast<uint8_t>(key >> 8),
          static_cast<uint8_t>(key >> 16)};
}

}  // namespace voxeld
