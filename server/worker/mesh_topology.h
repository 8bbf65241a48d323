// Whether a mesh closes.
#pragma once

#include <cstdint>
#include <optional>

#include "server/scene/scene.h"

namespace voxeld {

// Counts over undirected edges, after vertices of all parts with bit-identical positions are taken
// as one. Triangles that name a vertex twice have no area and are left out.
struct MeshTopology {
  int64_t distinct_positions = 0;
  int64_t degenerate_triangles = 0;
  int64_t open_edges = 0;          // in one triangle
  int64_t non_manifold_edges = 0;  // in more than two
  int64_t flipped_edges = 0;       // in two that run along it in the same direction
  bool watertight() const { return open_edges == 0 && non_manifold_edges == 0; }
};

// Largest mesh that is looked at: it takes about 40 bytes per triangle for a moment.
inline constexpr int64_t kTopologyTrianglesMax = 20'000'000;

// nullopt above kTopologyTrianglesMax.
std::optional<MeshTopology> mesh_topology(const Scene& scene);

}  // namespace voxeld
