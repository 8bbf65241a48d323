// The context in which a voxel's attributes are coded: the neighbours with lower numbers, which the
// decoder already has. proto/README.md specifies it.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "proto/codec/occupancy_model.h"
#include "proto/codec/voxel_numbers.h"

namespace voxeld {

inline constexpr size_t kAttributeComponentsMax = 4;

struct NeighborStep {
  int x = 0, y = 0, z = 0;
  uint32_t weight = 0;  // in means: 3 across a face, 2 across an edge, 1 across a corner
};

// The 26 neighbours: across faces, edges, corners; among those by ascending z, then y, then x.
constexpr std::array<NeighborStep, 26> make_neighbor_steps() {
  std::array<NeighborStep, 26> steps{};
  size_t count = 0;
  for (int distance = 1; distance <= 3; ++distance) {
    for (int i = 0; i < 27; ++i) {
      const int x = i % 3 - 1, y = i / 3 % 3 - 1, z = i / 9 - 1;
      if (x * x + y * y + z * z != distance) continue;
      steps[count++] = {x, y, z, static_cast<uint32_t>(4 - distance)};
    }
  }
  return steps;
}
inline constexpr std::array<NeighborStep, 26> kNeighborSteps = make_neighbor_steps();

// A summary of the coded neighbours of one voxel.
struct AttributeNeighbors {
  uint32_t count = 0;       // coded neighbours
  uint32_t first = 0;       // number of the first of them; the voxel before where there are none
  uint32_t other = 0;       // the first of them that differs from `first`; else `first`
  uint32_t same_count = 0;  // coded neighbours that equal `first`
  uint32_t error = 0;       // mean of their errors
  std::array<int, kAttributeComponentsMax> mean{};   // weighted
  std::array<int, kAttributeComponentsMax> range{};  // largest less smallest
};

// Buckets 0..7 for the values 0, 1, 2, 3..4, 5..8, 9..16, 17..32 and more.
constexpr uint32_t quantized(uint32_t value) {
  return value <= 2 ? value : std::min(static_cast<uint32_t>(std::bit_width(value - 1)) + 1, 7u);
}

// Buckets of a signed difference. 0: none; 1..4: positive, ascending; 5..8: negative.
constexpr uint32_t quantized_difference(int difference) {
  if (difference == 0) return 0;
  const auto size = static_cast<uint32_t>(difference < 0 ? -difference : difference);
  const uint32_t step = size <= 1 ? 1 : size <= 4 ? 2 : size <= 16 ? 3 : 4;
  return difference < 0 ? step + 4 : step;
}

// `samples` has `components` per voxel and `errors` one byte per voxel. Both are known only for
// voxels below `number`.
template <typename Sample>
AttributeNeighbors attribute_neighbors(const VoxelNumbers& numbers,
                                       const std::array<uint32_t, 3>& cell, uint32_t number,
                                       std::span<const Sample> samples, size_t components,
                                       std::span<const uint8_t> errors) {
  constexpr int kSampleMax = std::numeric_limits<Sample>::max();
  AttributeNeighbors found;
  std::array<int, kAttributeComponentsMax> sum{}, low{}, high{};
  low.fill(kSampleMax);
  uint32_t weights = 0, error = 0;
  for (const NeighborStep& step : kNeighborSteps) {
    const uint32_t voxel =
        numbers.find(static_cast<int>(cell[0]) + step.x, static_cast<int>(cell[1]) + step.y,
                     static_cast<int>(cell[2]) + step.z);
    if (voxel >= number) continue;  // not coded yet, or no voxel
    if (found.count++ == 0) found.first = found.other = voxel;
    weights += step.weight;
    error += errors[voxel];
    bool same = true;
    for (size_t c = 0; c < components; ++c) {
      const int sample = samples[voxel * components + c];
      sum[c] += static_cast<int>(step.weight) * sample;
      low[c] = std::min(low[c], sample);
      high[c] = std::max(high[c], sample);
      same = same && sample == samples[found.first * components + c];
    }
    found.same_count += same ? 1 : 0;
    if (!same && found.other == found.first) found.other = voxel;
  }
  if (found.count == 0) {
    found.first = found.other = number == 0 ? 0 : number - 1;
    for (size_t c = 0; c < components; ++c) {
      found.mean[c] = number == 0 ? kSampleMax / 2 + 1 : samples[found.first * components + c];
    }
    return found;
  }
  found.error = error / found.count;
  for (size_t c = 0; c < components; ++c) {
    found.mean[c] = (sum[c] + static_cast<int>(weights / 2)) / static_cast<int>(weights);
    found.range[c] = high[c] - low[c];
  }
  return found;
}

}  // namespace voxeld
