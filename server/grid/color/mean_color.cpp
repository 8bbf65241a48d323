#include <array>
#include <cmath>
#include <cstdint>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/grid/grid.h"

namespace voxeld {
namespace {

constexpr uint64_t kLinearOne = 1u << 20;

// Linear light of each sRGB byte. Integers, so sums do not depend on their order.
const std::array<uint64_t, 256>& linear_table() {
  static const std::array<uint64_t, 256> table = [] {
    std::array<uint64_t, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      const double linear = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
      made[i] = static_cast<uint64_t>(std::llround(linear * static_cast<double>(kLinearOne)));
    }
    return made;
  }();
  return table;
}

// The byte whose linear light is nearest.
uint8_t nearest_byte(uint64_t linear) {
  const auto& table = linear_table();
  size_t byte = 0;
  while (byte < 255 && 2 * linear > table[byte] + table[byte + 1]) ++byte;
  return static_cast<uint8_t>(byte);
}

}  // namespace

std::array<uint8_t, 3> mean_color(const Grid& grid) {
  std::array<std::array<uint64_t, 256>, 3> counts{};
  uint64_t weight = 0;
  for (const SparseTile& tile : grid.tiles) {
    for (size_t i = 0; i + 4 <= tile.color.size(); i += 4) {
      cancel_point_at(i / 4);
      const uint64_t alpha = tile.color[i + 3];
      for (size_t c = 0; c < 3; ++c) counts[c][tile.color[i + c]] += alpha;
      weight += alpha;
    }
  }
  if (weight == 0) return kNeutralColor;
  std::array<uint8_t, 3> mean{};
  for (size_t c = 0; c < 3; ++c) {
    uint64_t sum = 0;
    for (size_t byte = 0; byte < 256; ++byte) sum += counts[c][byte] * linear_table()[byte];
    mean[c] = nearest_byte((sum + weight / 2) / weight);
  }
  return mean;
}

}  // namespace voxeld
