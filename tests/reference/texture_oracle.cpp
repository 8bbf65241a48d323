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

std::array<double, 256> linear_table() {
  std::array<double, 256> table{};
  for (size_t i = 0; i < table.size(); ++i) table[i] = linear_from_srgb(double(i) / 255);
  return table;
}

}  // namespace

std::array<double, 4> texture_color(const Texture& texture, double u, double v) {
  static const std::array<double, 256> linear = linear_table();
  const double x = u * texture.width - 0.5, y = v * texture.height - 0.5;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  std::array<double, 4> color{};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double weight = (i == 0 ? left + 1 - x : x - left) * (j == 0 ? top + 1 - y : y - top);
      const int column = texel_number(left + i, texture.width, texture.edge_u);
      const int row = texel_number(top + j, texture.height, texture.edge_v);
      const uint8_t* texel =
          &texture.rgba[4 * (static_cast<size_t>(row) * static_cast<size_t>(texture.width) +
                             static_cast<size_t>(column))];
      const double alpha = weight * texel[3] / 255;
      for (size_t c = 0; c < 3; ++c) color[c] += alpha * linear[texel[c]];
      color[3] += alpha;
    }
  }
  return color;
}

}  // namespace voxeld::reference
