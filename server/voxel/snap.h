// Scene -> triangles with integer coordinates in grid space: step 1 to 3 of the definition in
// README.md. From here on everything is exact.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/scene/scene.h"

namespace voxeld {

inline constexpr int kSubVoxelsPerVoxel = 1 << limits::kSubVoxelBits;

// q of a grid-space coordinate: the vertex stands at (q + 1/2) / 256 voxels. `dim`: cells on this
// axis. The coordinate must be in [-1, dim + 1].
int32_t snap_coordinate(double p_grid, int dim);

struct SnappedTriangle {
  std::array<uint32_t, 3> vertices{};  // indices into SnappedMesh::vertices, as in the file
  uint32_t part = 0;                   // of the scene
  uint32_t tiles = 0;                  // first and last tile of its bounding box, see TileSpan
};

// A vertex that clipping made: attributes are those of the triangle's corners, weighted.
struct ClippedVertex {
  std::array<uint32_t, 3> corners{};  // indices into SnappedMesh::vertices, of the file's vertices
  std::array<double, 3> weights{};
};

// First and last tile on each axis, inclusive, in 4 bits each: x first in the lowest.
struct TileSpan {
  std::array<uint32_t, 3> first{}, last{};
  uint32_t packed() const;
  static TileSpan unpack(uint32_t packed);
};

struct SnappedMesh {
  // Vertices stand at (q + 1/2) / 2^sub_voxel_bits voxels.
  int sub_voxel_bits = limits::kSubVoxelBits;
  // q per axis. First the vertices of all parts, in the order of the scene; then those that
  // clipping made. Vertices that lie outside the box and are only used by clipped triangles have
  // kOutside as x.
  std::vector<glm::ivec3> vertices;
  std::vector<uint32_t> part_first_vertex;  // per part; index of its first vertex
  uint32_t file_vertex_count = 0;           // vertices[file_vertex_count + i] is clipped[i]
  std::vector<ClippedVertex> clipped;
  // That touch the grid's box; grouped by the image of their material (ascending; none first), in
  // the order of the scene within a group.
  std::vector<SnappedTriangle> triangles;
};

inline constexpr int32_t kOutside = INT32_MIN;

// Index of the image that a part's colours come from; -1: none.
int part_image(const Scene& scene, size_t part);

// Box of the vertices that triangles use, in world space. Empty when there is no triangle.
Box3d world_bounds(const Scene& scene, const glm::dmat4& world_from_file);

// Errors: malformed-mesh for a vertex that is not finite.
Result<SnappedMesh> snap_scene(const Scene& scene, const glm::dmat4& world_from_file,
                               const GridSpec& spec);

}  // namespace voxeld
