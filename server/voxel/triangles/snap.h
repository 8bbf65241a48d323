// Conversion of a scene to triangles with integer coordinates in grid space: steps 1 to 3 of the
// definition in README.md. Everything after this is exact.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/limits.h"
#include "proto/result.h"
#include "server/base/raw_vector.h"
#include "server/grid/grid_spec.h"
#include "server/scene/core/scene.h"

namespace voxeld {

inline constexpr int kSubVoxelsPerVoxel = 1 << limits::kSubVoxelBits;

// The integer coordinate q of a grid-space coordinate: the vertex is at (q + 1/2) / 256 voxels.
// dim: cells on this axis. p_grid must be in [-1, dim + 1].
int32_t snap_coordinate(double p_grid, int dim);

struct SnappedTriangle {
  std::array<uint32_t, 3> vertices;  // indices into SnappedMesh::vertices, as in the file
  uint32_t part;                     // index in the scene
};

// A vertex that clipping or splitting made. Its attributes are the weighted means of the triangle's
// corners.
struct ClippedVertex {
  std::array<uint32_t, 3> corners{};  // indices into SnappedMesh::vertices, of the file's vertices
  std::array<double, 3> weights{};
};

struct SnappedMesh {
  // q per axis. The vertices of all parts come first, in the scene's order; those that clipping and
  // splitting made follow. A vertex outside the box that only clipped triangles use has kOutside as
  // x.
  RawVector<glm::ivec3> vertices;
  std::vector<uint32_t> part_first_vertex;  // index of each part's first vertex
  uint32_t file_vertex_count = 0;           // vertices[file_vertex_count + i] is clipped[i]
  std::vector<ClippedVertex> clipped;
  // Triangles that touch the grid's box. They are grouped by the image of their material
  // (ascending, none first). Within a group they are in the scene's order; the pieces of a part
  // come last in it.
  RawVector<SnappedTriangle> triangles;
  // True if every vertex is in a cell of the grid. Then these are all of the scene's triangles,
  // none in pieces. They stay the same when vertices move, as long as this holds.
  bool is_whole = false;
};

inline constexpr int32_t kOutside = INT32_MIN;

// Index of the image that gives a part its colours; -1: none.
int part_image(const Scene& scene, size_t part);

// Box, in world space, of the vertices that triangles use. Empty if there is no triangle.
Box3d world_bounds(const Scene& scene, const glm::dmat4& world_from_file);

// Snaps the scene. bytes_max: limit for the pieces of clipped and split triangles. before: empty,
// or the mesh of this scene with its vertices elsewhere; its memory and its valid triangles are
// used again. Errors: malformed-mesh if a vertex is not finite, grid-too-large if the pieces exceed
// the limit.
Result<SnappedMesh> snap_scene(const Scene& scene, const glm::dmat4& world_from_file,
                               const GridSpec& spec, int64_t bytes_max = INT64_MAX,
                               SnappedMesh before = {});

// Moves triangles that lie on a plane between cells, within the step of snapping, to the cells that
// they face away from: by one step at most. They get vertices of their own. is_mirrored: triangles
// face the other way in the world than in the file.
void settle_faces(const glm::ivec3& dims, bool is_mirrored, SnappedMesh& mesh);

}  // namespace voxeld
