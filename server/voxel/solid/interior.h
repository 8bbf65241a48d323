// interior=nearest: attributes for the inside voxels that are not surface.
#pragma once

#include <span>
#include <vector>

#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/voxel/solid/inside/inside.h"
#include "server/voxel/solid/merge.h"

namespace voxeld {

// Turns full nodes into full masks, because only voxels of masks can have attributes.
void spell_out_full(SparseTile& tile);

// Bytes that all voxels of the tiles take as masks with attributes, plus those of the search for
// the nearest.
int64_t interior_bytes(const GridSpec& spec, std::span<const SparseTile> surface,
                       std::span<const SparseTile> inside, const ChannelSet& channels);

// Gives the voxels of `tiles` (all in masks) that are not in `surface` the attributes of the
// nearest surface voxel, by NearestCells. progress: called from time to time, with 0 columns done.
Status copy_nearest(std::span<const SparseTile> surface, const GridSpec& spec, ThreadTeam& team,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles);

}  // namespace voxeld
