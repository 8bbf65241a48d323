// What a request costs, and whether it fits, before anything is computed.
#pragma once

#include <cstdint>

#include "proto/channels.h"
#include "proto/options.h"
#include "proto/result.h"
#include "server/voxel/attribute_records.h"

namespace voxeld {

// Where the mesh lies: the first step of every request.
struct Placed {
  glm::dmat4 world_from_file{1.0};
  GridSpec spec;
};
// Errors: empty-mesh when there is no triangle, those of place_grid().
Result<Placed> place_scene(const Scene& scene, const VoxelizeOptions& options);

// What a request's options and a scene's contents give.
struct WantedChannels {
  ChannelSet grid;
  bool shaded = false;
  AttributeChannels summed;
  bool volume = false;     // coverage is of the voxel's volume, not its surface
  bool nearest = false;    // colours are those of points, found by the CPU, and not of sums
  bool has_alpha = false;  // some colour is not opaque
  // What the records of triangles tell of.
  AttributeChannels recorded() const {
    AttributeChannels channels = summed;
    channels.color = grid.color;
    channels.alpha = has_alpha;
    return channels;
  }
  // Whether pipelines have attributes to make; distances and volumes are measured after them.
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

// Bytes of a sparse result all of whose cells are occupied; a result never needs more.
int64_t dense_result_bytes(const GridSpec& spec, const WantedChannels& channels);

// Upper estimate of the bytes of the sparse result, at most the dense one's: a triangle touches at
// most (a + 2)(b + 2) columns in its two longer directions, and four cells in each, or as many as
// it is deep.
int64_t result_bytes(const SnappedMesh& mesh, const GridSpec& spec, const WantedChannels& channels);

// What fill=solid and shell need more than the surface, whose result_bytes() are given: bricks of
// the inside beside those of the surface and while both are united, crossings of columns, and what
// each thread keeps. The walls that an open mesh casts along an axis of parity come on top. 0 for
// fill=surface without distances.
int64_t fill_bytes(const SnappedMesh& mesh, const GridSpec& spec, const VoxelizeOptions& options,
                   int64_t surface_bytes, int threads);

// Errors: grid-too-large.
Status check_host_bytes(const GridSpec& spec, int64_t bytes, int64_t bytes_max);

// Three quarters of the machine's memory.
int64_t default_host_bytes_max();

}  // namespace voxeld
