// Surface and inside in one tile.
#pragma once

#include <vector>

#include "proto/sparse_tile.h"
#include "server/voxel/cpu/worker_pool.h"

namespace voxeld {

// What voxels that are not surface have, where voxels of a tile have attributes: (0,0,0,0) and
// (0,0,0).
struct TileChannels {
  bool color = false, normal = false;
};

// The cells of both, canonical, with the attributes of `surface`. Full nodes of the inside stay
// what they are but for bricks that hold surface with attributes.
SparseTile merge_tile(const SparseTile& surface, const SparseTile& inside,
                      const TileChannels& channels);

// Adds the inside to a grid's tiles, which need be in no order, and leaves them in ascending Morton
// order of coord.
void merge_tiles(std::vector<SparseTile> inside, const TileChannels& channels, WorkerPool& pool,
                 std::vector<SparseTile>& tiles);

}  // namespace voxeld
