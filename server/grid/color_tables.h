// sRGB (IEC 61966-2-1) to and from 16-bit linear light, as tables that every pass and the CPU
// share.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace voxeld {

// round(65535 * linear light) of an sRGB byte.
const std::array<uint32_t, 256>& linear16_from_srgb8();
// round(255 * sRGB) of 16-bit linear light; 65536 entries. Inverse of the above on its values.
const std::vector<uint8_t>& srgb8_from_linear16();

}  // namespace voxeld
