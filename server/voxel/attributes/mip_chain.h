// The mip levels of a texture, averaged in linear light.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/core/scene.h"

namespace voxeld {

struct MipLevel {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // sRGB and linear alpha; row 0 is the top
};

// Number of levels down to 1 x 1. Level l has max(1, side >> l) texels a side.
int level_count(int width, int height);

// Builds levels first..last (inclusive, < level_count). A texel is the average of the area that it
// covers in the level before. That is two texels a side; on an odd side it is 2 n + 1 texels over
// n, three of them weighted by their covered parts. RGB is averaged in 16-bit linear light,
// weighted by alpha too unless all of it is 0, and rounded to 16 bits. Each level is made from the
// one before it, then converted to sRGB bytes.
std::vector<MipLevel> build_mip_levels(const Image& image, int first, int last);

}  // namespace voxeld
