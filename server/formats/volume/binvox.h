// The limit of a .binvox, which is a cube around the grid.
#pragma once

#include "proto/result.h"
#include "server/grid/grid_spec.h"

namespace voxeld::volume {

// Errors: grid-too-large if the cube of the grid's longest side has more than
// limits::kDenseCellsMax cells, which readers allocate.
Status check_binvox(const GridSpec& spec);

}  // namespace voxeld::volume
