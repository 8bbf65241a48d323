// Conversion of a scene to a grid, tile by tile, by any pipeline. Every pipeline, driver and
// instruction set gives the same bytes: coverage and attribute sums are integers from the snapped
// vertices on.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/scene/core/scene.h"
#include "server/voxel/frames/shared_frames.h"
#include "server/voxel/pipelines/choose.h"
#include "server/voxel/pipelines/tile_pipeline.h"
#include "server/voxel/tiles/tile_sink.h"

namespace voxeld {

// Progress of a request; returning false cancels it (error `cancelled`). Called with 0 of 0 between
// the steps that prepare, with 0 done when the total is known, then after every tile or few.
using TileProgress = std::function<bool(int64_t tiles_done, int64_t tiles_total)>;

// The cost of a request, before anything is computed.
struct VoxelizeEstimate {
  GridSpec spec;
  int64_t tiles = 0;
  int64_t device_bytes = 0;  // peak: tile mask, triangle windows, attribute window, textures
  int64_t host_bytes = 0;    // upper estimate of the sparse result, the snapped mesh and its trees
  int64_t tree_bytes = 0;    // of these: trees of triangles, which do not depend on the grid
  int64_t voxels = 0;        // upper estimate; all cells where the inside is filled
  // The pipeline that would run, and why. Its time is predicted if the device is calibrated.
  PipelineDecision pipeline;
};

// Voxelizes requests, and keeps the pipelines between jobs. Not thread-safe.
class Voxelizer {
 public:
  // device: runs pipelines raster and compute; null leaves only cpu. cpu_threads: 0 means one per
  // hardware thread.
  explicit Voxelizer(std::unique_ptr<TilePipeline> device = nullptr, int cpu_threads = 0);
  ~Voxelizer();

  // Voxelizes a scene. A mesh that touches no cell of the grid's box is not an error; it gives an
  // empty grid. Errors: grid-too-large with estimate and limit, cancelled, internal with the
  // driver's words, unsupported-feature if the pipeline needs a GL context and there is none.
  Result<Grid> voxelize(const Scene& scene, const VoxelizeOptions& options,
                        const TileProgress& progress, VoxelizeStats* stats);

  // The same, tile by tile. If the sink does not keep tiles, only the mesh and a batch of tiles
  // must fit into memory. Errors: also the sink's.
  Status voxelize(const Scene& scene, const VoxelizeOptions& options, TileSink& sink,
                  const TileProgress& progress, VoxelizeStats* stats);
  // The same for a frame of an animation. `frames` places it and holds what it shares with earlier
  // frames. Call end_frames() after the last frame, also after an error.
  Status voxelize(const Scene& scene, const VoxelizeOptions& options, SharedFrames* frames,
                  TileSink& sink, const TileProgress& progress, VoxelizeStats* stats);
  void end_frames();

  // Places the grid, snaps the mesh and checks limits. Errors: as voxelize().
  Result<VoxelizeEstimate> estimate(const Scene& scene, const VoxelizeOptions& options) const;

  // The most device memory that the request takes, in bytes, computed without the mesh. 0 if the
  // device uses the machine's memory.
  int64_t device_bytes(const Scene& scene, const VoxelizeOptions& options) const;

  // Requests whose estimate of host memory exceeds this are grid-too-large. Default: three quarters
  // of the machine's memory.
  void set_host_bytes_max(int64_t bytes);

  // Sets the measurements by which `auto` chooses, or the reason why there are none.
  void set_calibration(CalibrationLookup calibration);

  // Sets the parts of the device that are not used. `auto` takes others, and the CPU fills. A
  // request that names such a pipeline is refused with unsupported-feature.
  void set_device_faults(DeviceFaults faults);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld
