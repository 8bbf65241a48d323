// Codec `small` for octrees: a tile's octree, entropy coded with contexts. It takes about a quarter
// of the bytes of codec fast, at a hundredth of its speed.
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

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"

namespace voxeld {

// Voxels above which a tile is stored as octants, which can be decoded in parallel. Octants learn
// apart and do not see each other's cells, which costs bytes. Smaller tiles decode quickly anyway
// and stay whole.
inline constexpr uint64_t kSmallVoxelsWhole = 1 << 18;

// The tile must be canonical and not empty. Its attributes are ignored.
std::vector<uint8_t> encode_octree_small(const SparseTile& tile);

// Fills brick_morton, masks and full; the tile is canonical. `has_attributes`: as for
// tile_from_octree(). Errors: bad-request for another layout, lengths that disagree, streams that
// are cut off or longer than their bits, and full nodes that are spelled out. Whatever the bytes
// are, it takes at most 8 MiB beside the result and the time of 19.3 million bits.
Status decode_octree_small(std::span<const uint8_t> bytes, bool has_attributes, SparseTile& tile);

}  // namespace voxeld
