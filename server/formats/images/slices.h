// The placement of slices in one image, and its limits.
#pragma once

#include <cstdint>

#include "proto/result.h"
#include "server/grid/grid_spec.h"

namespace voxeld::images {

// Pixels along a side of an atlas: what viewers of PNG take. More: grid-too-large.
inline constexpr int64_t kAtlasSideMax = 32767;

// Slices beside and below each other, left to right and top to bottom, z = 0 first.
struct AtlasLayout {
  int columns, rows;      // of slices
  int64_t width, height;  // pixels
};

// The layout whose longest side is shortest; of several, that of the fewest pixels, then of the
// fewest columns.
AtlasLayout atlas_layout(const GridSpec& spec);
// Errors: grid-too-large with the sides, the limit and what has none.
Status check_atlas(const GridSpec& spec);

}  // namespace voxeld::images
