// sign=flood: what the outside does not reach.
#pragma once

#include <span>
#include <vector>

#include "server/voxel/solid/inside.h"

namespace voxeld {

// Appends the cells of the grid that no path of face neighbours through cells that are not in
// `touched` joins to the outside of the grid; those of `touched` belong to it. Tiles are canonical,
// in any order. `progress`: called from time to time, with 0 columns done.
Status flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles);

}  // namespace voxeld
