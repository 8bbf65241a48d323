// Counts the connected components of a mesh, and those that are inside others.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "server/worker/mesh/mesh_topology.h"

namespace voxeld {

// Fills in components, enclosed_components and inner_walls. Each of `triangles` has three position
// numbers.
void count_components(std::span<const std::array<uint32_t, 3>> triangles,
                      const std::vector<glm::dvec3>& positions, MeshTopology& topology);

}  // namespace voxeld
