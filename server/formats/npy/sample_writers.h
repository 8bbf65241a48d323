// The samples of a channel as NumPy has them, for dense arrays and rows of voxels.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "server/base/cancel_point.h"
#include "server/grid/grid.h"

namespace voxeld {

inline float linear_from_srgb(uint8_t byte) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      made[i] = static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
    }
    return made;
  }();
  return table[byte];
}

template <typename T>
void put(uint8_t* at, T value) {
  std::memcpy(at, &value, sizeof value);
}

template <typename T>
void put_run(uint8_t* at, size_t count, T value) {
  if constexpr (sizeof(T) == 1) {
    std::memset(at, static_cast<uint8_t>(value), count);
  } else {
    for (size_t i = 0; i < count; ++i) put(at + i * sizeof(T), value);
  }
}

// The writers. cell(): the samples of a voxel with attributes, of one component or all; run():
// those of cells of full nodes; background(): those of the others.

template <typename T>
struct OccupancyWriter {
  static constexpr size_t kCellBytes = sizeof(T);
  void cell(uint8_t* at, const SparseTile&, size_t, size_t) const { put(at, T{1}); }
  void run(uint8_t* at, size_t cells) const { put_run(at, cells, T{1}); }
  void background(std::span<uint8_t> bytes) const { std::ranges::fill(bytes, uint8_t{0}); }
};

template <Channel channel, typename Stored, bool is_float, bool is_planar>
struct SampleWriter {
  static constexpr const ChannelInfo& kInfo = channel_info(channel);
  static constexpr Stored kLargest = std::numeric_limits<Stored>::max();
  using Sample = std::conditional_t<is_float, float, Stored>;
  static constexpr size_t kSamples = is_planar ? 1 : kInfo.components;
  static constexpr size_t kCellBytes = kSamples * sizeof(Sample);

  std::vector<Stored> SparseTile::*member;

  static Sample sample(Stored stored, size_t component) {
    if constexpr (!is_float) {
      return stored;
    } else if (kInfo.kind == ChannelKind::kColor && component < 3) {
      return linear_from_srgb(static_cast<uint8_t>(stored));
    } else {
      return static_cast<float>(stored) / static_cast<float>(kLargest);
    }
  }
  void cell(uint8_t* at, const SparseTile& tile, size_t voxel, size_t component) const {
    const Stored* stored = (tile.*member).data() + kInfo.components * voxel;
    if constexpr (is_planar) {
      put(at, sample(stored[component], component));
    } else {
      for (size_t c = 0; c < kSamples; ++c) put(at + c * sizeof(Sample), sample(stored[c], c));
    }
  }
  void run(uint8_t* at, size_t cells) const {
    if constexpr (kInfo.kind == ChannelKind::kFraction) put_run(at, cells, sample(kLargest, 0));
  }
  void background(std::span<uint8_t> bytes) const { std::ranges::fill(bytes, uint8_t{0}); }
};

template <typename Member>
struct DistanceWriter {
  static constexpr size_t kCellBytes = sizeof(float);
  Member member;
  double unit;  // distance_unit() of the grid
  float outside, inside;

  void cell(uint8_t* at, const SparseTile& tile, size_t voxel, size_t) const {
    put(at, static_cast<float>((tile.*member)[voxel] * unit / kDistanceSteps));
  }
  void run(uint8_t* at, size_t cells) const { put_run(at, cells, inside); }
  void background(std::span<uint8_t> bytes) const {
    put_run(bytes.data(), bytes.size() / sizeof(float), outside);
  }
};

// The largest distance of the grid, in distance_unit(): the value of cells far from the surface.
inline float farthest(const Grid& grid, auto member) {
  int steps = 1;
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    for (const int16_t distance : tile.*member) steps = std::max(steps, std::abs(distance));
  }
  return static_cast<float>(steps) / static_cast<float>(kDistanceSteps);
}

// Calls use(writer) with the writer of a channel's samples; channel nullopt: of occupancy.
// is_planar: a component at a time. In a band of distances, cells without one are NaN.
template <typename Use>
void with_sample_writer(const Grid& grid, std::optional<Channel> channel,
                        const OutputOptions& options, bool is_planar, Use&& use) {
  const bool is_float = options.dtype == DType::kFloat32;
  if (!channel) return is_float ? use(OccupancyWriter<float>{}) : use(OccupancyWriter<uint8_t>{});
  with_channel_member(*channel, [&](auto which, auto member) {
    constexpr const ChannelInfo& kInfo = channel_info(which);
    using Stored = SampleOf<decltype(member)>;
    if constexpr (kInfo.kind == ChannelKind::kDistance) {
      const double unit = distance_unit(grid);
      const auto far = static_cast<float>(farthest(grid, member) * unit);
      use(DistanceWriter<decltype(member)>{member, unit, grid.meta.is_band() ? NAN : far, -far});
    } else {
      const auto choose = [&]<bool as_float>() {
        is_planar ? use(SampleWriter<which(), Stored, as_float, true>{member})
                  : use(SampleWriter<which(), Stored, as_float, false>{member});
      };
      is_float && !kInfo.is_id() ? choose.template operator()<true>()
                                 : choose.template operator()<false>();
    }
  });
}

}  // namespace voxeld
