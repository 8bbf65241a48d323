// fill=shell: the inside cells that are near the surface.
#pragma once

#include <span>
#include <vector>

#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

// Removes from `inside` the cells that are not within `thickness` voxels (1..256) of a cell of
// `surface`. Distances are exact squared ones between centres. progress: called from time to time,
// with 0 columns done.
Status keep_shell(std::span<const SparseTile> surface, double thickness, ThreadTeam& team,
                  const ColumnProgress& progress, std::vector<SparseTile>& inside);

// The largest integer that is not above thickness^2.
int64_t squared_limit(double thickness);

}  // namespace voxeld
