#include "server/grid/color/color_tables.h"

#include <cmath>
#include <cstddef>

namespace voxeld {

const std::array<uint32_t, 256>& linear16_from_srgb8() {
  static const auto table = [] {
    std::array<uint32_t, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) {
      const double c = static_cast<double>(i) / 255.0;
      const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
      made[i] = static_cast<uint32_t>(std::floor(65535.0 * linear + 0.5));
    }
    return made;
  }();
  return table;
}

const std::vector<uint8_t>& srgb8_from_linear16() {
  static const auto table = [] {
    std::vector<uint8_t> made(65536);
    for (size_t i = 0; i < made.size(); ++i) {
      const double c = static_cast<double>(i) / 65535.0;
      const double srgb = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
      made[i] = static_cast<uint8_t>(std::floor(255.0 * srgb + 0.5));
    }
    return made;
  }();
  return table;
}

}  // namespace voxeld
