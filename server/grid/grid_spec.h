// The placement of a grid in the world, computed from a mesh's bounds and a request.
#pragma once

#include <cstdint>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld {

// Cell (i,j,k) covers [i,i+1) x [j,j+1) x [k,k+1) in grid space.
// p_grid = (p_world - origin_world) / voxel_size, per axis.
struct GridSpec {
  glm::ivec3 dims{1};            // cells, each 1..kGridSideMax
  glm::dvec3 origin_world{0.0};  // min corner of cell (0,0,0)
  glm::dvec3 voxel_size{1.0};    // world units per cell, each > 0

  int64_t cell_count() const { return static_cast<int64_t>(dims.x) * dims.y * dims.z; }
  // Tiles on each side: ceil(dims / kTileSide).
  glm::ivec3 tile_dims() const;
  glm::dvec3 grid_from_world(const glm::dvec3& p_world) const {
    return (p_world - origin_world) / voxel_size;
  }
  glm::dvec3 world_from_grid(const glm::dvec3& p_grid) const {
    return origin_world + p_grid * voxel_size;
  }
};

// The matrix from the file's coordinates to world space: `up`, then `transform`.
glm::dmat4 world_from_file(const PlacementOptions& options);

// Places the grid around [bounds_min, bounds_max] (world, of the transformed mesh; the request's
// `bounds` replace it). Rules, in server/grid/README.md with examples:
//  size N:      cubic voxels, longest side is exactly N cells including padding;
//  dims:        cubic voxels that fit; with `bounds`, exactly the box, voxels may be non-cubic;
//  voxel_size:  as many cells as cover the box.
// The box is centred in the grid. Flat sides get one cell. Errors: grid-too-large (says dims and
// limit), invalid-option (padding leaves no room, empty bounds).
Result<GridSpec> place_grid(const PlacementOptions& options, const glm::dvec3& bounds_min,
                            const glm::dvec3& bounds_max);

}  // namespace voxeld
