#include "server/voxel/attributes/mip_chain.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"
#include "server/base/raw_vector.h"
#include "server/grid/color/color_tables.h"

namespace voxeld {
namespace {

constexpr size_t kRowGrain = 64;

// Linear RGB and alpha, 16 bits each.
using Texel = std::array<uint16_t, 4>;

struct LinearLevel {
  int width = 0, height = 0;
  RawVector<Texel> texels;
};

// The texels of the next larger level that one texel covers along an axis, and their weights.
struct Taps {
  int first = 0, count = 1;
  std::array<uint64_t, 3> weights{1, 0, 0};
  uint64_t sum = 1;
};

Taps taps_of(int source, int target, int at) {
  if (source == 1) return {};
  if (source % 2 == 0) return {2 * at, 2, {1, 1, 0}, 2};
  const auto n = static_cast<uint64_t>(target), d = static_cast<uint64_t>(at);
  return {2 * at, 3, {n - d, n, d + 1}, 2 * n + 1};
}

// Averages rows [begin, end) of `target`; texel(x, y) reads the larger level.
template <typename ReadTexel>
void average_rows(int source_width, int source_height, LinearLevel& target, int begin, int end,
                  const ReadTexel& texel) {
  for (int y = begin; y < end; ++y) {
    cancel_point();
    const Taps rows = taps_of(source_height, target.height, y);
    for (int x = 0; x < target.width; ++x) {
      const Taps columns = taps_of(source_width, target.width, x);
      std::array<uint64_t, 4> sums{};
      std::array<uint64_t, 3> seen{};  // weighted by alpha
      for (int j = 0; j < rows.count; ++j) {
        for (int i = 0; i < columns.count; ++i) {
          const uint64_t weight =
              rows.weights[static_cast<size_t>(j)] * columns.weights[static_cast<size_t>(i)];
          const Texel value = texel(columns.first + i, rows.first + j);
          for (size_t c = 0; c < 4; ++c) sums[c] += weight * value[c];
          for (size_t c = 0; c < 3; ++c) seen[c] += weight * value[c] * value[3];
        }
      }
      const uint64_t total = rows.sum * columns.sum;
      Texel& out = target.texels[static_cast<size_t>(y) * static_cast<size_t>(target.width) +
                                 static_cast<size_t>(x)];
      for (size_t c = 0; c < 4; ++c) out[c] = static_cast<uint16_t>((sums[c] + total / 2) / total);
      const uint64_t alpha = sums[3];
      for (size_t c = 0; c < 3 && alpha != 0; ++c) {
        out[c] = static_cast<uint16_t>((seen[c] + alpha / 2) / alpha);
      }
    }
  }
}

template <typename ReadTexel>
LinearLevel half(int width, int height, const ReadTexel& texel) {
  LinearLevel target{std::max(1, width / 2), std::max(1, height / 2), {}};
  target.texels.resize(static_cast<size_t>(target.width) * static_cast<size_t>(target.height));
  parallel_chunks(
      static_cast<size_t>(target.height), kRowGrain, [&](size_t, size_t begin, size_t end) {
        average_rows(width, height, target, static_cast<int>(begin), static_cast<int>(end), texel);
      });
  return target;
}

MipLevel encoded(const LinearLevel& level) {
  const auto& srgb8 = srgb8_from_linear16();
  MipLevel out{level.width, level.height, {}};
  out.rgba.reserve(4 * level.texels.size());
  for (int y = 0; y < level.height; ++y) {
    cancel_point();
    const Texel* const row =
        &level.texels[static_cast<size_t>(y) * static_cast<size_t>(level.width)];
    for (int x = 0; x < level.width; ++x) {
      const Texel& texel = row[x];
      for (size_t c = 0; c < 3; ++c) out.rgba.push_back(srgb8[texel[c]]);
      out.rgba.push_back(static_cast<uint8_t>((texel[3] + 128u) / 257u));
    }
  }
  return out;
}

}  // namespace

int level_count(int width, int height) {
  return std::bit_width(static_cast<uint32_t>(std::max({width, height, 1})));
}

std::vector<MipLevel> build_mip_levels(const Image& image, int first, int last) {
  std::vector<MipLevel> levels;
  if (first == 0) {
    levels.push_back(
        {image.width, image.height, copied_in_pieces(image.rgba.data(), image.rgba.size())});
  }
  const auto& linear16 = linear16_from_srgb8();
  LinearLevel level;
  for (int number = 1; number <= last; ++number) {
    if (number == 1) {
      level = half(image.width, image.height, [&](int x, int y) {
        const uint8_t* p =
            &image.rgba[4 * (static_cast<size_t>(y) * static_cast<size_t>(image.width) +
                             static_cast<size_t>(x))];
        return Texel{static_cast<uint16_t>(linear16[p[0]]), static_cast<uint16_t>(linear16[p[1]]),
                     static_cast<uint16_t>(linear16[p[2]]), static_cast<uint16_t>(p[3] * 257)};
      });
    } else {
      level = half(level.width, level.height, [&level](int x, int y) {
        return level.texels[static_cast<size_t>(y) * static_cast<size_t>(level.width) +
                            static_cast<size_t>(x)];
      });
    }
    if (number >= first) levels.push_back(encoded(level));
  }
  return levels;
}

}  // namespace voxeld
