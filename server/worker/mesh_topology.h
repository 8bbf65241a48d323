// Whether a mesh closes, and what parts it has.
#pragma once

#include <cstdint>
#include <optional>

#include "server/scene/scene.h"

namespace voxeld {

// Counts over undirected edges, after vertices of all parts with bit-identical positions are taken
// as one. Triangles that name a vertex twice have no area and are left out.
struct MeshTopology {
  // "vertices" of every description, of whatever format: points that triangles use.
  int64_t distinct_positions = 0;
  int64_t degenerate_triangles = 0;
  int64_t open_edges = 0;          // in one triangle
  int64_t non_manifold_edges = 0;  // in more than two
  int64_t flipped_edges = 0;       // in two that run along it in the same direction
  // Edges that triangles do not run along as often in one direction as in the other.
  int64_t unbalanced_edges = 0;
  int64_t components = 0;  // parts that share no position
  // Components whose first vertex lies inside of another, closed one (which winds
  // around it there), and those of them that are closed and turned like it: their inside is inside
  // of another, so their faces are walls that no outside sees. Unset where it would take long.
  std::optional<int64_t> enclosed_components;
  std::optional<int64_t> inner_walls;
  bool watertight() const { return open_edges == 0 && non_manifold_edges == 0; }
  // Every triangle's edges cancel out: winding numbers are integers.
  bool closed() const { return unbalanced_edges == 0; }
};

// Pairs of components, and triangles of outer ones, that are looked at for enclosed components:
// each takes some 3 ns.
inline constexpr int64_t kEnclosureTestsMax = 10'000'000;

// Largest mesh that is looked at: it takes about 60 bytes per triangle for a moment.
inline constexpr int64_t kTopologyTrianglesMax = 20'000'000;

// nullopt above kTopologyTrianglesMax.
std::optional<MeshTopology> mesh_topology(const Scene& scene);
// MeshTopology::distinct_positions of one part alone.
int64_t distinct_positions(const MeshPart& part);

}  // namespace voxeld
