// The memory that a request needs, and whether it fits, before anything is computed.
#pragma once

#include <cstdint>

#include "proto/channels.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/voxel/attributes/attribute_records.h"

namespace voxeld {

// The mesh's place in the grid: the first step of every request.
struct Placed {
  glm::dmat4 world_from_file{1.0};
  GridSpec spec;
};
// Places the grid. Errors: empty-mesh if there is no triangle, those of place_grid().
Result<Placed> place_scene(const Scene& scene, const VoxelizeOptions& options);

// The channels that follow from a request's options and a scene's contents.
struct WantedChannels {
  ChannelSet grid;
  bool shaded = false;
  AttributeChannels summed;
  bool volume = false;     // coverage is of the voxel's volume, not of its surface
  bool nearest = false;    // colours are those of nearest points, found by the CPU, not of sums
  bool has_alpha = false;  // at least one colour is not opaque
  // The channels that the records of triangles describe.
  AttributeChannels recorded() const {
    AttributeChannels channels = summed;
    channels.color = grid.color;
    channels.alpha = has_alpha;
    return channels;
  }
  // True if the pipelines have attributes to compute. Distances and volumes do not count, because
  // they are measured after the pipelines.
  bool any() const {
    ChannelSet made = grid;
    made.distance = false;
    made.coverage = made.coverage && !volume;
    return made.any();
  }
};
WantedChannels wanted_channels(const Scene& scene, const VoxelizeOptions& options);

// Bytes of the snapped mesh and its bins.
int64_t mesh_bytes(const Scene& scene);

// Bytes of a sparse result with all cells occupied: the upper bound of every result.
int64_t dense_result_bytes(const GridSpec& spec, const WantedChannels& channels);

// Upper estimates of the surface's size, at most all of the grid's. A triangle is taken to touch at
// most (a + 2)(b + 2) columns in its two longer directions. In each column it touches four cells,
// or as many as the triangle is deep.
struct SurfaceSize {
  int64_t voxels = 0;
  int64_t bricks = 0;

  int64_t bytes(const WantedChannels& channels) const;  // as sparse tiles
};
SurfaceSize surface_size(const SnappedMesh& mesh, const GridSpec& spec);

// Bytes that fill=solid and shell need in addition to the surface, whose tiles have
// `surface_bytes`. Counted are bricks of the inside while they are united with those of the
// surface, crossings of columns, and the scratch memory of each thread. Not counted are the walls
// that an open mesh casts along an axis of parity. Returns 0 for fill=surface without distances.
int64_t fill_bytes(const SnappedMesh& mesh, const GridSpec& spec, const VoxelizeOptions& options,
                   int64_t surface_bytes, int threads);

// Errors: grid-too-large if `bytes` exceeds `bytes_max`.
Status check_host_bytes(const GridSpec& spec, int64_t bytes, int64_t bytes_max);

// Three quarters of the machine's memory.
int64_t default_host_bytes_max();

}  // namespace voxeld
