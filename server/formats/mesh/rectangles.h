// The outer faces of voxels, one by one or merged to rectangles.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/formats/bricks/voxel_bricks.h"
#include "server/formats/mesh/voxel_colors.h"

namespace voxeld::mesh {

// Rectangles of a mesh, of which a square of one voxel is the smallest; those of 2^27 take 2 GiB.
// More: grid-too-large.
inline constexpr uint64_t kRectanglesMax = uint64_t{1} << 27;

// A rectangle [u0, u1) x [v0, v1) of a plane of the lattice, in cells from the tile's first one.
struct Rectangle {
  uint16_t u0, v0, u1, v1;
  uint16_t plane;    // coordinate along the normal's axis
  bool is_positive;  // the normal points up the axis
  Rgba color;
};

// The axes u and v of planes across each axis.
inline constexpr std::array<std::array<size_t, 2>, 3> kPlaneAxes = {{{1, 2}, {0, 2}, {0, 1}}};

// The rectangles of a tile's slab of bricks across an axis.
struct RectangleSlab {
  uint32_t tile;
  uint32_t axis;
  int at;  // along the axis, in bricks from the tile's first one
  std::vector<Rectangle> rectangles;
};

// All faces between a cell inside and one outside. merge: faces of a plane that adjoin and have the
// same colour become rectangles, within a tile; each begins at the first face left, in the order of
// v and u, is as wide as possible and then as high as possible. Without `colors`, all colours are
// the same. Errors: grid-too-large for more than `count_max` rectangles, which names the format.
Result<std::vector<RectangleSlab>> find_rectangles(const VoxelBricks& voxels,
                                                   const VoxelColors* colors, bool merge,
                                                   std::string_view format,
                                                   uint64_t count_max = kRectanglesMax);

}  // namespace voxeld::mesh
