// Positions in world space and texts about a grid's placement, for formats without transforms.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "server/formats/mesh/surface_mesh.h"
#include "server/grid/grid.h"

namespace voxeld::mesh {

// Whether floats hold the world's coordinates to 1/256 of a voxel. Otherwise doubles are written.
bool fits_float(const GridSpec& spec);

inline glm::dvec3 world_position(const GridSpec& spec, const Vertex& vertex) {
  const auto& p = vertex.p_grid;
  return spec.world_from_grid(glm::dvec3(p[0], p[1], p[2]));
}

// A unit normal. Voxels need not be cubes.
std::array<float, 3> world_normal(const GridSpec& spec, const std::array<float, 3>& normal);

// Lines for comments: dims, origin, voxel_size, and units and transform if the request had them.
std::vector<std::string> placement_lines(const Grid& grid);

}  // namespace voxeld::mesh
