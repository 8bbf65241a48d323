// How voxels become LDraw's bricks.
#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "proto/messages/job.h"
#include "server/grid/grid_spec.h"

namespace voxeld::ldraw {

// A brick of one voxel, in LDraw's units.
inline constexpr glm::ivec3 kBrickUnits{20, 24, 20};

// "brick-proportions" if voxels do not have those of a brick, so that the model is stretched.
std::vector<Warning> brick_warnings(const GridSpec& spec);

}  // namespace voxeld::ldraw
