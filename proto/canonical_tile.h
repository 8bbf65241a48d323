// The one form that a set of voxels has (proto/sparse_tile.h), for those who write or hash tiles
// that they may not change.
#pragma once

#include "proto/sparse_tile.h"

namespace voxeld {

// Whether canonicalize() would leave the tile as it is. Needs `full` in ascending order.
// `has_attributes`: the voxels of masks have some, whether or not the tile holds them yet.
bool is_canonical(const SparseTile& tile, bool has_attributes);

// The tile itself where it is canonical; else its canonical form, which `copy` then holds.
const SparseTile& canonical_form(const SparseTile& tile, SparseTile& copy);

// Whether `full` has nodes inside the tile, aligned to their size and ascending, none of which
// overlaps another or a brick of `brick_morton` (ascending).
bool full_nodes_are_apart(const SparseTile& tile);

}  // namespace voxeld
