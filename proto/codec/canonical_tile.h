// The canonical form of a tile (proto/codec/sparse_tile.h), for callers that write or hash tiles
// but must not change them.
#pragma once

#include "proto/codec/sparse_tile.h"

namespace voxeld {

// Whether every voxel of the brick is occupied.
bool is_full(const BrickMask& mask);

// Whether canonicalize() would leave the tile as it is. Needs `full` in ascending order.
// `has_attributes` says whether the voxels of masks have any, even if the tile does not hold them
// yet.
bool is_canonical(const SparseTile& tile, bool has_attributes);

// The tile itself if it is canonical; otherwise its canonical form, which is stored in `copy`.
const SparseTile& canonical_form(const SparseTile& tile, SparseTile& copy);

// Whether the full nodes are valid: inside the tile, aligned to their size, ascending, and none
// overlaps another or a brick of `brick_morton` (ascending).
bool full_nodes_are_apart(const SparseTile& tile);

}  // namespace voxeld
