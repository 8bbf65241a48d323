// interior=nearest: attributes for the voxels inside that are not surface.
#pragma once

#include <span>
#include <vector>

#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/solid/inside.h"
#include "server/voxel/solid/merge.h"

namespace voxeld {

// Makes full nodes full masks, whose voxels can have attributes.
void spell_out_full(SparseTile& tile);

// What all voxels of the tiles as masks with attributes and the search for the nearest need, in
// bytes.
int64_t interior_bytes(const GridSpec& spec, std::span<const SparseTile> surface,
                       std::span<const SparseTile> inside, const ChannelSet& channels);

// Gives the voxels of `tiles` (in masks, all of them) that are not in `surface` the attributes of
// the nearest voxel that is: NearestCells. `progress`: called from time to time, with 0 columns
// done.
Status copy_nearest(std::span<const SparseTile> surface, const GridSpec& spec, WorkerPool& pool,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles);

}  // namespace voxeld
