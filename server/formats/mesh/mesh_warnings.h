// Warnings about data of a grid that a mesh does not hold.
#pragma once

#include <vector>

#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// "lost-channels" names the channels that a mesh has no place for; "lost-alpha" is for transparent
// voxels in an .obj, and as instances; "not-metres" for a .glb of a grid in other units, as readers
// of glTF take all coordinates for metres. A grid without tiles, that of a sequence, has no
// lost-alpha.
std::vector<Warning> mesh_warnings(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld::mesh
