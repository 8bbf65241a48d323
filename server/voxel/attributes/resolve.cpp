#include "server/voxel/attributes/resolve.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/floor.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"
#include "server/grid/color/color_tables.h"

namespace voxeld {
namespace {

__extension__ using Wide = unsigned __int128;

constexpr size_t kVoxelGrain = 1 << 13;

// Phong 1975, "Illumination for computer generated images". The light is white and directional,
// from above and in front; the viewer is at the front (+z). The thesis bakes this into its grids.
constexpr std::array<double, 3> kToLight = {1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0};
constexpr double kAmbient = 0.2, kDiffuse = 0.8, kSpecular = 0.25;  // exponent 16

// The weight of a surface as large as a cell's face, across its dominant axis.
constexpr uint64_t kFaceWeight = uint64_t{16} * 256;

struct Unit {
  double x = 0, y = 0, z = 0;
  bool valid = false;
};

struct Shade {
  double scale, add;  // applied to linear light
};

Shade phong(Unit n) {
  // Faces that cancel out have no normal. They are lit as if they faced the viewer.
  if (!n.valid) n = {0.0, 0.0, 1.0, true};
  const double toward = n.x * kToLight[0] + n.y * kToLight[1] + n.z * kToLight[2];
  if (toward <= 0.0) return {kAmbient, 0.0};
  // z of the light's mirror image about n, which is its cosine with the viewer.
  const double mirrored = std::max(0.0, 2.0 * toward * n.z - kToLight[2]);
  const double squared = mirrored * mirrored;
  const double fourth = squared * squared;
  const double eighth = fourth * fourth;
  return {kAmbient + kDiffuse * toward, kSpecular * (eighth * eighth)};
}

// A voxel's sums, stored in two halves.
class SplitSums {
 public:
  SplitSums(std::span<const uint32_t> sums, std::span<const uint32_t> carries, size_t at)
      : sums_(sums), carries_(carries), at_(at) {}
  uint64_t operator[](size_t channel) const {
    const uint64_t high = carries_.empty() ? 0u : carries_[at_ + channel];
    return sums_[at_ + channel] | high << 32;
  }

 private:
  std::span<const uint32_t> sums_, carries_;
  size_t at_;
};

uint32_t mean16(uint64_t sum, uint64_t weight) {
  return static_cast<uint32_t>((sum + weight / 2) / weight);
}

template <typename Sums>
Unit mean_normal(const Sums& sums, size_t first, uint64_t weight) {
  std::array<double, 3> v{};
  for (size_t c = 0; c < 3; ++c) {
    v[c] = static_cast<double>(static_cast<int64_t>(sums[first + c] - (weight << 15)));
  }
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  // A mean shorter than a thousandth is only the rounding that cancelled faces leave.
  if (length < 32.767 * static_cast<double>(weight)) return {};
  return {v[0] / length, v[1] / length, v[2] / length, true};
}

uint8_t shaded_srgb8(uint32_t linear16, const Shade& shade) {
  const double linear = static_cast<double>(linear16) * shade.scale + 65535.0 * shade.add;
  return srgb8_from_linear16()[static_cast<size_t>(floor_to_int(std::min(linear, 65535.0) + 0.5))];
}

int8_t normal8(double n) {
  return static_cast<int8_t>(floor_to_int(127.0 * n + 0.5));
}

// sums: operator[] gives the voxel's sum of a channel.
template <typename Sums>
void resolve_voxel(const Sums& sums, const ResolveOptions& options, size_t voxel,
                   SparseTile& tile) {
  const AttributeChannels& channels = options.channels;
  const uint64_t weight = sums[0];
  if (weight == 0) return;  // never for an occupied voxel
  Unit normal;
  if (channels.normal) normal = mean_normal(sums, channels.count() - 3, weight);
  if (options.write.color) {
    const auto& srgb8 = srgb8_from_linear16();
    uint8_t* out = &tile.color[4 * voxel];
    const Shade shade = options.shaded ? phong(normal) : Shade{1.0, 0.0};
    const auto mean = straight_mean({sums[1], sums[2], sums[3], channels.alpha ? sums[4] : 0},
                                    weight, channels.alpha);
    for (size_t c = 0; c < 3; ++c) {
      out[c] = options.shaded ? shaded_srgb8(mean[c], shade) : srgb8[mean[c]];
    }
    out[3] = alpha8(mean[3]);
  }
  if (options.write.coverage) {
    tile.coverage[voxel] = static_cast<uint8_t>(
        std::min<uint64_t>((255 * weight + kFaceWeight / 2) / kFaceWeight, 255));
  }
  if (options.write.normal) {
    int8_t* out = &tile.normal[3 * voxel];
    out[0] = normal8(normal.x);
    out[1] = normal8(normal.y);
    out[2] = normal8(normal.z);
  }
}

}  // namespace

uint8_t alpha8(uint32_t alpha16) {
  return static_cast<uint8_t>((alpha16 + 128u) / 257u);
}

std::array<uint32_t, 4> straight_mean(const std::array<uint64_t, 4>& sums, uint64_t weight,
                                      bool has_alpha) {
  if (!has_alpha) {
    return {mean16(sums[0], weight), mean16(sums[1], weight), mean16(sums[2], weight), 65535};
  }
  // Alpha is stored, so it decides what is visible: where it is 0, sums may be rounding alone.
  const uint32_t alpha = mean16(sums[3], weight);
  if (alpha8(alpha) == 0) return {65535, 65535, 65535, alpha};
  std::array<uint32_t, 4> mean{0, 0, 0, alpha};
  for (size_t c = 0; c < 3; ++c) {
    const Wide straight = (Wide{sums[c]} * 65535 + sums[3] / 2) / sums[3];
    mean[c] = static_cast<uint32_t>(std::min<Wide>(straight, 65535));
  }
  return mean;
}

void resolve_voxels(std::span<const uint32_t> sums, std::span<const uint32_t> carries,
                    const ResolveOptions& options, size_t voxel_first, SparseTile& tile) {
  const size_t stride = options.channels.count();
  parallel_chunks(sums.size() / stride, kVoxelGrain, [&](size_t, size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      cancel_point_at(v);
      resolve_voxel(SplitSums(sums, carries, v * stride), options, voxel_first + v, tile);
    }
  });
}

void resolve_voxels(std::span<const uint64_t> sums, const ResolveOptions& options,
                    size_t voxel_first, SparseTile& tile) {
  const size_t stride = options.channels.count();
  for (size_t v = 0; v < sums.size() / stride; ++v) {
    cancel_point_at(v);
    resolve_voxel(&sums[v * stride], options, voxel_first + v, tile);
  }
}

}  // namespace voxeld
