// Bricks of a tile <-> breadth-first octree of child masks (proto/grid_format.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// Most bytes that a tile's octree can have: 1 + 8 + ... + 8^7.
inline constexpr size_t kOctreeBytesMax = 2'396'745;

// The tile must not be empty.
std::vector<uint8_t> octree_from_bricks(const SparseTile& tile);

// Fills brick_morton and masks. Errors: bad-request, for empty nodes, missing or extra bytes.
Status bricks_from_octree(std::span<const uint8_t> octree, SparseTile& tile);

}  // namespace voxeld
