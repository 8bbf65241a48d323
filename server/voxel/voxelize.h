// Scene -> Grid by any pipeline, tile by tile. The same bytes from every pipeline, driver and
// instruction set: coverage and attribute sums are integers from the snapped vertices on.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/scene/scene.h"
#include "server/voxel/choose.h"
#include "server/voxel/shared_frames.h"
#include "server/voxel/tile_pipeline.h"
#include "server/voxel/tile_sink.h"

namespace voxeld {

// Called with 0 of 0 between the steps that prepare, with 0 done when the total is known, then as
// tiles get done, one or a few at a time; false cancels (the error is then `cancelled`).
using TileProgress = std::function<bool(int64_t tiles_done, int64_t tiles_total)>;

// What a request will cost, before anything is computed.
struct VoxelizeEstimate {
  GridSpec spec;
  int64_t tiles = 0;
  int64_t device_bytes = 0;  // peak: tile mask, triangle windows, attribute window, textures
  int64_t host_bytes = 0;    // upper estimate of the sparse result and the snapped mesh
  // Of the pipeline that would run, and why that; the time where the device is calibrated.
  PipelineDecision pipeline;
};

// Keeps the pipelines between jobs. One thread.
class Voxelizer {
 public:
  // `device` runs pipelines raster and compute; without one there is only cpu. cpu_threads: 0 is as
  // many as the machine has.
  explicit Voxelizer(std::unique_ptr<TilePipeline> device = nullptr, int cpu_threads = 0);
  ~Voxelizer();

  // Errors: grid-too-large with estimate and limit, empty-mesh when no triangle touches the grid's
  // box is NOT an error (an empty grid), cancelled, unsupported-feature for a pipeline that needs a
  // GL context where there is none, internal with the driver's words.
  Result<Grid> voxelize(const Scene& scene, const VoxelizeOptions& options,
                        const TileProgress& progress, VoxelizeStats* stats);

  // The same, tile by tile. Where the sink does not keep tiles, only the mesh and a batch of tiles
  // need to fit into memory. Errors: also the sink's.
  Status voxelize(const Scene& scene, const VoxelizeOptions& options, TileSink& sink,
                  const TileProgress& progress, VoxelizeStats* stats);
  // The same of a frame: placed as `frames` says, and without making anew what it has in common
  // with the frames before it. end_frames() after the last one, also after an error.
  Status voxelize(const Scene& scene, const VoxelizeOptions& options, SharedFrames* frames,
                  TileSink& sink, const TileProgress& progress, VoxelizeStats* stats);
  void end_frames();

  // Places the grid, snaps the mesh and checks limits. Errors: as voxelize().
  Result<VoxelizeEstimate> estimate(const Scene& scene, const VoxelizeOptions& options) const;

  // Bytes that the request takes of a device's own memory at most, without looking at the mesh; 0
  // where it runs on the machine's.
  int64_t device_bytes(const Scene& scene, const VoxelizeOptions& options) const;

  // Requests that are estimated to need more memory of the machine are grid-too-large. Default:
  // three quarters of it.
  void set_host_bytes_max(int64_t bytes);

  // What `auto` decides by: measurements of this device, or why there are none.
  void set_calibration(CalibrationLookup calibration);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld
