// The corners of voxels that can lie on the outline of an image, whatever the camera.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "server/grid/grid.h"

namespace voxeld {

// Points in grid space whose convex hull holds all occupied cells; empty if there are none. They
// are the corners of the hull itself where no side of the grid has more than 1024 cells. Otherwise
// the cells are joined to cubes, so that the hull is larger by up to 1/512 of the longest side.
// Takes time in proportion to the voxels, and memory for a million rows of cells.
std::vector<glm::ivec3> hull_points(const Grid& grid);

}  // namespace voxeld
