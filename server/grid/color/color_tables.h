// Tables from sRGB (IEC 61966-2-1) to 16-bit linear light and back. Every pass and the CPU share
// them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace voxeld {

// Maps an sRGB byte to round(65535 * linear light).
const std::array<uint32_t, 256>& linear16_from_srgb8();
// Maps 16-bit linear light to round(255 * sRGB); 65536 entries. It inverts the table above on its
// values.
const std::vector<uint8_t>& srgb8_from_linear16();

}  // namespace voxeld
