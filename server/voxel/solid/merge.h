// Surface and inside in one tile.
#pragma once

#include <vector>

#include "proto/sparse_tile.h"
#include "server/voxel/cpu/worker_pool.h"

namespace voxeld {

// The cells of both, canonical, with the attributes of `surface`; voxels that are not surface have
// 0 in bricks that have attributes. Full nodes of the inside stay what they are but for bricks that
// hold surface with attributes.
SparseTile merge_tile(const SparseTile& surface, const SparseTile& inside,
                      const ChannelSet& channels);

// Adds the inside to a grid's tiles, which need be in no order, and leaves them in ascending Morton
// order of coord.
void merge_tiles(std::vector<SparseTile> inside, const ChannelSet& channels, WorkerPool& pool,
                 std::vector<SparseTile>& tiles);

}  // namespace voxeld
