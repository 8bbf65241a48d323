// The octree of a tile, entropy coded with contexts: the stream of codec `small`. About a quarter
// of the bytes of the fast codec, at a hundredth of its speed.
//
//   byte 0   u8 layout: 0, 1 or 2
//   layout 0, a tile of at most kSmallVoxelsWhole voxels outside full nodes:
//        1   one range-coded stream: the head, then the cells of the whole tile
//   layout 1, more voxels: the octants of 128 cells can be decoded at the same time
//        1   u32 bytes of the head
//        5   u32[8] bytes of each octant in Morton order; 0 where there is nothing to say
//       37   the head, then the octants, each a range-coded stream
//   layout 2, an entirely full tile: nothing more
//
//   head     whether there are full nodes; occupancy of the nodes of 128, 64, 32, 16 and 8 cells,
//            each level followed by which of its nodes are full
//   octant   occupancy of the nodes of 4 and 2 cells and of the cells, in bricks that are not full
//
// proto/README.md specifies the bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "proto/sparse_tile.h"

namespace voxeld {

// Above it a tile is stored as octants. They learn apart and do not see each other's cells, which
// costs bytes, so tiles that decode quickly anyway stay whole.
inline constexpr uint64_t kSmallVoxelsWhole = 1 << 18;

// The tile must be canonical and not empty; its attributes are not looked at.
std::vector<uint8_t> encode_octree_small(const SparseTile& tile);

// Fills brick_morton, masks and full, which gives a canonical tile. `has_attributes`: whether the
// voxels of masks have any (tile_from_octree()). Errors: bad-request, for another layout, lengths
// that disagree, streams that are cut off or longer than their bits, full nodes that are spelled
// out. Takes at most 8 MiB besides the result, and the time of at most 19.3 million bits, whatever
// the bytes are.
Status decode_octree_small(std::span<const uint8_t> bytes, bool has_attributes, SparseTile& tile);

}  // namespace voxeld
