// The boundary of a mesh, i.e. the edges where its triangles do not cancel out, and cones that
// close it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "server/voxel/solid/inside/fill_mesh.h"

namespace voxeld {

// A directed edge between snapped positions. Triangles run along it `count` times more often than
// against it.
struct BoundaryEdge {
  glm::ivec3 from{0}, to{0};
  int count = 0;  // > 0
};

// The boundary of the mesh as a chain of edges. It is empty iff the snapped mesh is closed and
// consistently oriented; its winding number is then an integer everywhere. Vertices with equal q
// count as one. Sorted by (from, to), so that the order of triangles and of their corners does not
// matter.
std::vector<BoundaryEdge> boundary_edges(const FillMesh& mesh);

// Triangles, three corners each, that close the mesh. Over every connected part of the boundary
// they form a cone from the middle of its vertices. They are in the order of the edges.
std::vector<glm::ivec3> closing_cones(const std::vector<BoundaryEdge>& boundary);

}  // namespace voxeld
