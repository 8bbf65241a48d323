// fill=shell: the inside that is near to the surface.
#pragma once

#include <span>
#include <vector>

#include "server/voxel/solid/inside.h"

namespace voxeld {

// Leaves of `inside` the cells whose centre lies within `thickness` voxels (1..256) of the centre
// of a cell of `surface`, by exact squared distances. `progress`: called from time to time, with 0
// columns done.
Status keep_shell(std::span<const SparseTile> surface, double thickness, WorkerPool& pool,
                  const ColumnProgress& progress, std::vector<SparseTile>& inside);

// The largest integer that is not above thickness^2.
int64_t squared_limit(double thickness);

}  // namespace voxeld
