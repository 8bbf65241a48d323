// Converts between a tile's bricks and full nodes and the breadth-first octree of child masks
// (proto/container/grid_format.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"

namespace voxeld {

// The most bytes that a tile's octree can have: 1 + 8 + ... + 8^7.
inline constexpr size_t kOctreeBytesMax = 2'396'745;

// The tile must be canonical and not empty.
std::vector<uint8_t> octree_from_tile(const SparseTile& tile);

// The counts that tile_from_octree() would find.
struct OctreeCounts {
  uint64_t bricks = 0;       // outside full nodes
  uint64_t mask_voxels = 0;  // of those bricks
  uint64_t voxels = 0;       // those of full nodes included
};
// Counts in a fraction of that time. Errors: bad-request for empty nodes below the bricks, and for
// missing or extra bytes. It does not check that full nodes are as large as possible.
Result<OctreeCounts> count_octree(std::span<const uint8_t> octree);

// Fills brick_morton, masks and full. The tile is canonical, as each tile has one octree.
// `has_attributes`: whether the voxels of masks have any; if so, a full mask differs from a full
// node. Errors: bad-request for empty nodes below the bricks, missing or extra bytes, and full
// nodes that are spelled out.
Status tile_from_octree(std::span<const uint8_t> octree, bool has_attributes, SparseTile& tile);

}  // namespace voxeld
