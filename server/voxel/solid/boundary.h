// What is missing of a mesh: the edges where its triangles do not cancel out, and cones that close
// it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/fill_mesh.h"

namespace voxeld {

// A directed edge between snapped positions that triangles run along `count` times more often than
// against it.
struct BoundaryEdge {
  glm::ivec3 from{0}, to{0};
  int count = 0;  // > 0
};

// The boundary of the mesh as a chain: empty iff the snapped mesh is closed and consistently
// oriented, so that its winding number is an integer everywhere. Vertices with equal q are one.
// Ascending by (from, to): neither the order of triangles nor of their corners matters.
std::vector<BoundaryEdge> boundary_edges(const FillMesh& mesh);

// Triangles that close the mesh, three corners each: over every connected part of the boundary a
// cone from the middle of its vertices. The mesh with them has no boundary. In the order of the
// edges.
std::vector<glm::ivec3> closing_cones(const std::vector<BoundaryEdge>& boundary);

}  // namespace voxeld
