// Reduces the colours of a grid to at most 255 palette entries, deterministically.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "server/grid/color/rgb.h"

namespace voxeld {

// The number of voxels by the colour's key.
using ColorCounts = std::unordered_map<uint32_t, uint64_t>;

struct Palette {
  std::vector<Rgb> colors;  // at most the requested number; empty if there are no counts
  std::unordered_map<uint32_t, uint8_t> index_of;  // maps every key of the counts
};

// Exact if there are few colours. Otherwise median cut (Heckbert 1982) by weighted variance in the
// perceptual space OKLab (Ottosson 2020), refined by k-means (Lloyd 1982). The result depends only
// on the counts, not on their order. Has cancellation points.
Palette make_palette(const ColorCounts& counts, int colors_max);

}  // namespace voxeld
