// Smaller levels of a texture, averaged in linear light.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/scene.h"

namespace voxeld {

struct MipLevel {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // sRGB and linear alpha, row 0 on top
};

// Levels of an image down to 1 x 1: level l has max(1, side >> l) texels a side.
int level_count(int width, int height);

// Levels first..last (inclusive, < level_count). A texel of the next level is the average of the
// area that it covers: two texels a side, or where the side is odd, 2 n + 1 texels over n, three of
// them weighted by the parts that are covered. RGB is averaged in 16-bit linear light without
// regard to alpha, every level from the one before it, and rounded to 16 bits; then to sRGB bytes.
std::vector<MipLevel> build_mip_levels(const Image& image, int first, int last);

}  // namespace voxeld
