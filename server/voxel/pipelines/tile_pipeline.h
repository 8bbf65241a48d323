// The interface of the pipelines: tiles of a planned request in, sparse tiles out. Every pipeline
// gives the same bytes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/codec/sparse_tile.h"
#include "proto/limits.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/base/clock.h"
#include "server/scene/core/scene.h"
#include "server/voxel/attributes/attribute_records.h"
#include "server/voxel/attributes/id_fold.h"
#include "server/voxel/attributes/resolve.h"
#include "server/voxel/estimates/cost_model.h"
#include "server/voxel/estimates/estimate.h"
#include "server/voxel/estimates/pipeline.h"
#include "server/voxel/pipelines/fill_stats.h"
#include "server/voxel/triangles/bin.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

struct DeviceCalibration;

// A request after placing and snapping, from which every tile is made. Its address must not change
// before end_job().
struct VoxelizePlan {
  const Scene& scene;
  const VoxelizeOptions& options;
  WantedChannels channels;
  GridSpec spec{};
  glm::dmat4 world_from_file{1.0};
  SnappedMesh mesh{};
  std::vector<int> part_images{};             // part_image() of every part that is sampled, else -1
  std::vector<IdChannel> ids{};               // one per id channel of the grid
  std::optional<AttributeRecords> records{};  // set if channels.any()
  // SharedFrames::textures_key(). Textures that were made for the same key serve this job and stay
  // for the next. 0: the textures are this job's alone.
  uint64_t textures_key = 0;
  // SharedFrames::mesh_key() if the mesh is whole: all jobs with this key have the same triangles.
  // 0: the triangles are this job's alone.
  uint64_t mesh_key = 0;
  // The device already has the vertices (DeviceSkin). `mesh` has current ones only if the CPU needs
  // them.
  bool has_device_vertices = false;
  // Drops the surface's cells that are outside: rule=none with attributes, whose surface is that of
  // rule=touch.
  bool keeps_inside = false;
  // Measured costs of the device's pipelines; null: there are none.
  const DeviceCalibration* calibration = nullptr;

  // True if the sums over all triangles are used. Channels of ids have sums of their own.
  bool needs_sums() const { return channels.summed.count() > 1 || channels.grid.coverage; }
  // True if run_tiles() of a device leaves work to CpuPipeline::finish_tiles().
  bool finishes_on_cpu() const {
    return channels.nearest || std::ranges::any_of(ids, &IdChannel::is_wide);
  }

  ResolveOptions resolve_options() const {
    ResolveOptions resolve{channels.summed, channels.shaded, channels.grid};
    resolve.write.color = channels.summed.color;
    return resolve;
  }
};

struct VoxelizeStats {
  Pipeline pipeline = Pipeline::kCompute;
  std::string pipeline_reason;  // why `auto` chose it
  std::string device_failure;   // the error after which the CPU went on; empty: there was none
  Workload work;                // the input of the prediction of `auto`
  int64_t triangles = 0;        // after clipping to the grid's box
  int64_t tiles = 0;            // tiles that triangles reach
  int64_t work_items = 0;
  int64_t device_bytes_peak = 0;
  // Bytes that pipeline compute uploads to hardware: vertices or poses, triangles, and lists of
  // triangle numbers.
  int64_t mesh_bytes_uploaded = 0;
  std::optional<FillStats> fill;  // only for solids and shells
  StageTimes passes;              // milliseconds by pass: snap bin upload occupancy attributes …
};

struct DeviceTraits {
  bool is_software = true;
  int texture_side_max = limits::kImageSideMax;  // larger levels of a texture are skipped
  bool has_int64 = true;                         // in shaders; attributes need them
};

// A pipeline. It keeps programs and scratch memory from job to job. Not thread-safe.
class TilePipeline {
 public:
  virtual ~TilePipeline() = default;

  // The plan and the statistics must outlive the job.
  virtual Status begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) = 0;
  // Tells the progress so far. An error, which the caller returns, says that the job is cancelled.
  using Pause = std::function<Status()>;
  // Appends the nonempty tiles of `bins`, in their order. Devices leave channels of wide ids and
  // colours of nearest points at 0 (VoxelizePlan::finishes_on_cpu()). They call `pause` between
  // long dispatches.
  virtual Status run_tiles(std::span<const TileBin> bins, const Pause& pause,
                           std::vector<SparseTile>& tiles) = 0;
  // Frees what only this job needed. Called after an error too.
  virtual void end_job() = 0;
  // Frees what a job kept for the next frame.
  virtual void end_frames() {}

  // Peak bytes on the device, without the texture levels that are sampled.
  virtual int64_t device_bytes(const Scene& scene, const WantedChannels& channels) const = 0;
  virtual DeviceTraits traits() const = 0;
  // Tiles per call of run_tiles(): the granularity of progress and cancelling.
  virtual size_t batch_tiles() const { return 1; }
};

}  // namespace voxeld
