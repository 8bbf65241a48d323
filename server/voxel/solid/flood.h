// The fill of sign=flood: all cells that the outside cannot reach.
#pragma once

#include <span>
#include <vector>

#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// Appends the cells that are cut off from the outside of the grid, including those of `touched`. A
// cell is cut off if no path of face neighbours outside `touched` joins it to the outside. Tiles
// are canonical, in any order. progress: called from time to time, with 0 columns done.
Status flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles);

}  // namespace voxeld
