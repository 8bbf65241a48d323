// A tile's bricks and full nodes <-> breadth-first octree of child masks (proto/grid_format.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// Most bytes that a tile's octree can have: 1 + 8 + ... + 8^7.
inline constexpr size_t kOctreeBytesMax = 2'396'745;

// The tile must be canonical and not empty.
std::vector<uint8_t> octree_from_tile(const SparseTile& tile);

// What tile_from_octree() finds.
struct OctreeCounts {
  uint64_t bricks = 0;       // outside full nodes
  uint64_t mask_voxels = 0;  // of those bricks
  uint64_t voxels = 0;       // those of full nodes included
};
// In a fraction of its time. Errors: bad-request, for empty nodes below the bricks and missing and
// extra bytes; whether full nodes are as large as can be is not looked at.
Result<OctreeCounts> count_octree(std::span<const uint8_t> octree);

// Fills brick_morton, masks and full, which gives a canonical tile: each tile has one octree.
// `has_attributes`: whether the voxels of masks have any, so that a full mask is not the same as a
// full node. Errors: bad-request, for empty nodes below the bricks, missing and extra bytes, and
// for full nodes that are spelled out.
Status tile_from_octree(std::span<const uint8_t> octree, bool has_attributes, SparseTile& tile);

}  // namespace voxeld
