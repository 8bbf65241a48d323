#include "tests/reference/texture_oracle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tests/reference/color_oracle.h"

namespace voxeld::reference {
namespace {

int texel_number(int at, int size, Edge edge) {
  if (edge == Edge::kClamp) return std::clamp(at, 0, size - 1);
  const int period = edge == Edge::kMirror ? 2 * size : size;
  const int in_period = (at % period + period) % period;
  return in_period < size ? in_period : period - 1 - in_period;
}

// The texels to both sides of a point along an axis, and the share of the second.
struct Pair {
  int first = 0, second = 0;
  double share = 0;
};

Pair pair_at(const std::array<double, 3>& corners, const std::array<double, 3>& shares, int size,
             Edge edge) {
  constexpr double kHalfUnit = 0x1p-21;  // coordinates are rounded to 2^-20
  double at = shares[0] * corners[0] + shares[1] * corners[1] + shares[2] * corners[2];
  if (edge == Edge::kRepeat) {
    const auto [least, most] = std::minmax({corners[0], corners[1], corners[2]});
    const double first = std::floor(least + kHalfUnit);
    if (most < first + 1 + kHalfUnit) {
      edge = Edge::kClamp;
      at -= first;
    }
  }
  const double x = at * size - 0.5;
  const int left = static_cast<int>(std::floor(x));
  return {texel_number(left, size, edge), texel_number(left + 1, size, edge), x - left};
}

std::array<double, 256> linear_table() {
  std::array<double, 256> table{};
  for (size_t i = 0; i < table.size(); ++i) table[i] = linear_from_srgb(double(i) / 255);
  return table;
}

}  // namespace

std::array<double, 4> texture_color(const Texture& texture,
                                    const std::array<TexturePoint, 3>& corners,
                                    const std::array<double, 3>& shares) {
  static const std::array<double, 256> linear = linear_table();
  const Pair x =
      pair_at({corners[0][0], corners[1][0], corners[2][0]}, shares, texture.width, texture.edge_u);
  const Pair y = pair_at({corners[0][1], corners[1][1], corners[2][1]}, shares, texture.height,
                         texture.edge_v);
  std::array<double, 4> color{};
  for (const bool below : {false, true}) {
    for (const bool right : {false, true}) {
      const double weight = (right ? x.share : 1 - x.share) * (below ? y.share : 1 - y.share);
      const auto column = static_cast<size_t>(right ? x.second : x.first);
      const auto row = static_cast<size_t>(below ? y.second : y.first);
      const uint8_t* texel = &texture.rgba[4 * (row * static_cast<size_t>(texture.width) + column)];
      const double alpha = weight * texel[3] / 255;
      for (size_t c = 0; c < 3; ++c) color[c] += alpha * linear[texel[c]];
      color[3] += alpha;
    }
  }
  return color;
}

}  // namespace voxeld::reference
