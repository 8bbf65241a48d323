#include "server/grid/color/oklab.h"

#include <cmath>
#include <cstddef>

namespace voxeld {
namespace {

// Linear light of an sRGB byte.
double linear_light(uint8_t byte) {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) {
      const double s = static_cast<double>(i) / 255.0;
      made[i] = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    }
    return made;
  }();
  return table[byte];
}

}  // namespace

Lab oklab(const std::array<uint8_t, 3>& srgb) {
  const double r = linear_light(srgb[0]), g = linear_light(srgb[1]), b = linear_light(srgb[2]);
  const double l = std::cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const double m = std::cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const double s = std::cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
          1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
          0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

}  // namespace voxeld
