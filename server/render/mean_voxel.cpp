#include "server/render/mean_voxel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace voxeld {
namespace {

// 16-bit linear light of each sRGB byte.
std::array<uint32_t, 256> make_linear() {
  std::array<uint32_t, 256> table{};
  for (size_t i = 0; i < table.size(); ++i) {
    const double c = static_cast<double>(i) / 255.0;
    const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    table[i] = static_cast<uint32_t>(std::lround(65535.0 * linear));
  }
  return table;
}

const std::array<uint32_t, 256> kLinear = make_linear();

// The sRGB byte with the nearest linear light.
uint32_t srgb_byte(uint32_t linear) {
  const auto above = std::lower_bound(kLinear.begin(), kLinear.end(), linear);
  if (above == kLinear.begin()) return 0;
  const auto byte = static_cast<uint32_t>(above - kLinear.begin());
  return *above - linear < linear - kLinear[byte - 1] ? byte : byte - 1;
}

bool is_visible(uint32_t color) {
  return color >> 24 != 0;
}

}  // namespace

uint32_t mean_color(std::span<const uint32_t> colors) {
  if (colors.empty()) return 0;
  const bool some_visible = std::ranges::any_of(colors, is_visible);
  std::array<uint64_t, 3> sums{};
  uint64_t count = 0;
  for (const uint32_t color : colors) {
    if (some_visible && !is_visible(color)) continue;
    for (size_t i = 0; i < 3; ++i) sums[i] += kLinear[color >> (8 * i) & 255];
    ++count;
  }
  uint32_t mean = some_visible ? 0xff000000u : 0;
  for (size_t i = 0; i < 3; ++i) {
    mean |= srgb_byte(static_cast<uint32_t>((sums[i] + count / 2) / count)) << (8 * i);
  }
  return mean;
}

double median_luminance(std::span<const uint32_t> colors) {
  constexpr size_t kSamplesMax = 100'000;
  const size_t step = colors.size() / kSamplesMax + 1;
  std::vector<double> luminances;
  luminances.reserve(colors.size() / step + 1);
  for (size_t i = 0; i < colors.size(); i += step) {
    if (!is_visible(colors[i])) continue;
    const auto linear = [&](int shift) { return kLinear[colors[i] >> shift & 255] / 65535.0; };
    luminances.push_back(0.2126 * linear(0) + 0.7152 * linear(8) + 0.0722 * linear(16));
  }
  if (luminances.empty()) return 1.0;
  const auto middle = luminances.begin() + static_cast<std::ptrdiff_t>(luminances.size() / 2);
  std::nth_element(luminances.begin(), middle, luminances.end());
  return *middle;
}

uint32_t mean_normal(std::span<const uint32_t> normals) {
  if (normals.empty()) return 0;
  std::array<int64_t, 3> sums{};
  for (const uint32_t normal : normals) {
    for (size_t i = 0; i < 3; ++i) sums[i] += static_cast<int8_t>(normal >> (8 * i));
  }
  std::array<int8_t, 3> mean{};
  for (size_t i = 0; i < 3; ++i) {
    mean[i] = static_cast<int8_t>(sums[i] / static_cast<int64_t>(normals.size()));
  }
  return pack_normal(mean[0], mean[1], mean[2]);
}

}  // namespace voxeld
