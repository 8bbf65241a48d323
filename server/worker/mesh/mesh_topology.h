// The topology of a mesh: whether it is closed, and which components it has.
#pragma once

#include <cstdint>
#include <optional>

#include "server/scene/core/scene.h"

namespace voxeld {

// Counts over undirected edges, after vertices with bit-identical positions are merged across all
// parts. Triangles that name a vertex twice have no area and are ignored.
struct MeshTopology {
  // Positions that triangles use: the "vertices" of every description, whatever the format.
  int64_t distinct_positions = 0;
  int64_t degenerate_triangles = 0;
  int64_t open_edges = 0;          // in one triangle
  int64_t non_manifold_edges = 0;  // in more than two
  int64_t flipped_edges = 0;       // in two triangles that run along it in the same direction
  // Edges that triangles do not traverse equally often in both directions.
  int64_t unbalanced_edges = 0;
  int64_t components = 0;  // sets of triangles that share no position
  // enclosed_components: components whose first vertex is inside another, closed one, which winds
  // around it there. inner_walls: those of them that are closed and oriented alike. Their inside is
  // inside another component, so their faces are invisible from outside. Unset if counting would
  // take long.
  std::optional<int64_t> enclosed_components;
  std::optional<int64_t> inner_walls;
  bool watertight() const { return open_edges == 0 && non_manifold_edges == 0; }
  // All edges cancel out, so winding numbers are integers.
  bool closed() const { return unbalanced_edges == 0; }
};

// Limit of pairs of components, and of triangles of outer ones, tested for enclosed components.
// Each test takes some 3 ns.
inline constexpr int64_t kEnclosureTestsMax = 10'000'000;

// The largest mesh that is examined; it takes about 60 bytes per triangle for a moment.
inline constexpr int64_t kTopologyTrianglesMax = 20'000'000;

// Returns nullopt above kTopologyTrianglesMax.
std::optional<MeshTopology> mesh_topology(const Scene& scene);
// MeshTopology::distinct_positions of a single part.
int64_t distinct_positions(const MeshPart& part);

}  // namespace voxeld
