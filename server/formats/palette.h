// Colours of a grid -> at most 255 palette entries, deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace voxeld {

using Rgb = std::array<uint8_t, 3>;

// Number of voxels by colour, key R | G << 8 | B << 16.
using ColorCounts = std::unordered_map<uint32_t, uint64_t>;

struct Palette {
  std::vector<Rgb> colors;  // at most the number asked for; none for no counts
  std::unordered_map<uint32_t, uint8_t> index_of;  // every key of the counts -> index
};

// Exact where there are few colours. Else median cut (Heckbert 1982) by weighted variance in the
// perceptual space OKLab (Ottosson 2020), refined by k-means (Lloyd 1982). The result depends on
// the counts alone, not on their order.
Palette make_palette(const ColorCounts& counts, int colors_max);

}  // namespace voxeld
