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
#include "server/voxel/raw_vector.h"

namespace voxeld {

inline constexpr int kSubVoxelsPerVoxel = 1 << limits::kSubVoxelBits;

// q of a grid-space coordinate: the vertex stands at (q + 1/2) / 256 voxels. `dim`: cells on this
// axis. The coordinate must be in [-1, dim + 1].
int32_t snap_coordinate(double p_grid, int dim);

struct SnappedTriangle {
  std::array<uint32_t, 3> vertices;  // indices into SnappedMesh::vertices, as in the file
  uint32_t part;                     // of the scene
};

// A vertex that clipping or splitting made: attributes are those of the triangle's corners,
// weighted.
struct ClippedVertex {
  std::array<uint32_t, 3> corners{};  // indices into SnappedMesh::vertices, of the file's vertices
  std::array<double, 3> weights{};
};

struct SnappedMesh {
  // q per axis. First the vertices of all parts, in the order of the scene; then those that
  // clipping and splitting made. Vertices that lie outside the box and are only used by clipped
  // triangles have kOutside as x.
  RawVector<glm::ivec3> vertices;
  std::vector<uint32_t> part_first_vertex;  // per part; index of its first vertex
  uint32_t file_vertex_count = 0;           // vertices[file_vertex_count + i] is clipped[i]
  std::vector<ClippedVertex> clipped;
  // That touch the grid's box; grouped by the image of their material (ascending; none first), in
  // the order of the scene within a group; of each part, pieces last.
  RawVector<SnappedTriangle> triangles;
  // Every vertex stands in a cell of the grid: the triangles are the scene's, all of them and none
  // in pieces, wherever the vertices move while that holds.
  bool is_whole = false;
};

inline constexpr int32_t kOutside = INT32_MIN;

// Index of the image that a part's colours come from; -1: none.
int part_image(const Scene& scene, size_t part);

// Box of the vertices that triangles use, in world space. Empty when there is no triangle.
Box3d world_bounds(const Scene& scene, const glm::dmat4& world_from_file);

// bytes_max: of the pieces of clipped and split triangles. before: empty, or what this scene was
// snapped to when its vertices stood elsewhere; its memory serves again, and triangles that are
// still right are not made anew. Errors: malformed-mesh for a vertex that is not finite,
// grid-too-large for more pieces.
Result<SnappedMesh> snap_scene(const Scene& scene, const glm::dmat4& world_from_file,
                               const GridSpec& spec, int64_t bytes_max = INT64_MAX,
                               SnappedMesh before = {});

}  // namespace voxeld
