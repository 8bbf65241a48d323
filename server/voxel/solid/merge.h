// The union of a surface tile and an inside tile.
#pragma once

#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/parallel.h"

namespace voxeld {

// The cells of both tiles, canonical, with the attributes of `surface`. In bricks that have
// attributes, voxels that are not surface have 0. Full nodes of the inside stay full nodes, except
// bricks that also hold surface with attributes.
SparseTile merge_tile(const SparseTile& surface, const SparseTile& inside,
                      const ChannelSet& channels);

// Adds the inside to a grid's tiles, which may be in any order. The result is in ascending Morton
// order of coord.
void merge_tiles(std::vector<SparseTile> inside, const ChannelSet& channels, ThreadTeam& team,
                 std::vector<SparseTile>& tiles);

// Leaves, of the tiles of a surface, the voxels that are inside, with their attributes. Full nodes
// of the surface have none and are not kept.
void keep_inside(const std::vector<SparseTile>& inside, std::vector<SparseTile>& surface);

}  // namespace voxeld
