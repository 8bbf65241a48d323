// The unit of a grid's distances, which its meta tells.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "proto/container/grid_format.h"

namespace voxeld {

// Whether a grid with this meta has distances in world units: its member `options` has
// distance=world. Otherwise they are in voxels along each axis.
bool has_world_distances(const nlohmann::json& meta);

// The value of kDistanceSteps stored steps: 1 voxel, or the shortest edge of a voxel in world
// units. It holds at every level of detail, since the edges are those of the grid's own voxels.
double distance_unit(bool is_world, const std::array<double, 3>& voxel_size);
double distance_unit(const GridHeader& header);

}  // namespace voxeld
