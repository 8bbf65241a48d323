// Scene -> Grid on a GL context, by either pipeline, tile by tile. Same bytes from both pipelines
// and every driver: coverage and attribute sums are integers from the snapped vertices on.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "proto/options.h"
#include "proto/result.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/grid/grid.h"
#include "server/scene/scene.h"

namespace voxeld {

enum class Pipeline { kRaster, kCompute };
std::string_view pipeline_name(Pipeline pipeline);

// Called after each tile; false cancels (the error is then `cancelled`).
using TileProgress = std::function<bool(int64_t tiles_done, int64_t tiles_total)>;

struct VoxelizeStats {
  Pipeline pipeline = Pipeline::kCompute;
  std::string pipeline_reason;  // why `auto` took it
  int64_t triangles = 0;        // after clipping to the grid's box
  int64_t tiles = 0;            // that triangles reach
  int64_t work_items = 0;
  int64_t device_bytes_peak = 0;
  StageTimes passes;  // milliseconds by pass: snap bin upload occupancy attributes …
};

// What a request will cost, before anything is computed.
struct VoxelizeEstimate {
  GridSpec spec;
  int64_t tiles = 0;
  int64_t device_bytes = 0;  // peak: tile mask, triangle windows, attribute window, textures
  int64_t host_bytes = 0;    // upper estimate of the sparse result and the snapped mesh
};

// Owns programs and scratch buffers on one context; keep it between jobs. One thread.
class Voxelizer {
 public:
  Voxelizer(gpu::Context& context, gpu::ShaderLibrary& shaders);
  ~Voxelizer();

  // Errors: grid-too-large with estimate and limit, empty-mesh when no triangle touches the grid's
  // box is NOT an error (an empty grid), cancelled, internal with the driver's words.
  Result<Grid> voxelize(const Scene& scene, const VoxelizeOptions& options,
                        const TileProgress& progress, VoxelizeStats* stats);

  // Places the grid, snaps the mesh and checks limits. Errors: as voxelize().
  Result<VoxelizeEstimate> estimate(const Scene& scene, const VoxelizeOptions& options) const;

  // Requests that are estimated to need more memory of the machine are grid-too-large. Default:
  // three quarters of it.
  void set_host_bytes_max(int64_t bytes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld
