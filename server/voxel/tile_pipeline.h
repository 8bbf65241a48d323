// What the pipelines have in common: tiles of a planned request in, sparse tiles out, and the same
// bytes from each.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/limits.h"
#include "proto/options.h"
#include "proto/result.h"
#include "proto/sparse_tile.h"
#include "server/base/stopwatch.h"
#include "server/scene/scene.h"
#include "server/voxel/attribute_records.h"
#include "server/voxel/bin.h"
#include "server/voxel/cost_model.h"
#include "server/voxel/estimate.h"
#include "server/voxel/fill_stats.h"
#include "server/voxel/id_fold.h"
#include "server/voxel/pipeline.h"
#include "server/voxel/resolve.h"
#include "server/voxel/snap.h"

namespace voxeld {

// A request after placing and snapping: what every tile of it is made from. Stays where it is until
// end_job().
struct VoxelizePlan {
  const Scene& scene;
  const VoxelizeOptions& options;
  WantedChannels channels;
  GridSpec spec{};
  glm::dmat4 world_from_file{1.0};
  SnappedMesh mesh{};
  std::vector<int> part_images{};             // part_image() of every part that is sampled, else -1
  std::vector<IdChannel> ids{};               // of the grid's channels that hold ids
  std::optional<AttributeRecords> records{};  // where channels.any()
  // SharedFrames::textures_key(): levels of images that were made for the same one serve this job
  // too, and stay for the next one. 0: they are this job's alone.
  uint64_t textures_key = 0;
  // SharedFrames::mesh_key() where the mesh is whole: its triangles are those of all such jobs. 0:
  // they are this job's alone.
  uint64_t mesh_key = 0;
  // The device has the vertices already (DeviceSkin); the mesh's stand here only where the CPU
  // wants them.
  bool has_device_vertices = false;

  // Whether anything comes of the sums over all triangles; ids have sums of their own.
  bool needs_sums() const { return channels.summed.count() > 1 || channels.grid.coverage; }
  // Whether run_tiles() of a device leaves something to CpuPipeline::finish_tiles().
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
  std::string pipeline_reason;  // why `auto` took it
  Workload work;                // what `auto` predicts from
  int64_t triangles = 0;        // after clipping to the grid's box
  int64_t tiles = 0;            // that triangles reach
  int64_t work_items = 0;
  int64_t device_bytes_peak = 0;
  // To hardware's pipeline compute: vertices or what moves them, triangles, numbers of triangles.
  int64_t mesh_bytes_uploaded = 0;
  std::optional<FillStats> fill;  // of solids and shells
  StageTimes passes;              // milliseconds by pass: snap bin upload occupancy attributes …
};

struct DeviceTraits {
  bool is_software = true;
  int texture_side_max = limits::kImageSideMax;  // larger levels of a texture are passed over
  bool has_int64 = true;                         // in shaders; attributes need them
};

// Keeps programs and scratch memory from job to job. One thread.
class TilePipeline {
 public:
  virtual ~TilePipeline() = default;

  // The plan and the statistics must outlive the job.
  virtual Status begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) = 0;
  // Appends the tiles of `bins` that are not empty, in their order. Devices leave channels
  // of wide ids and colours of nearest points 0 (VoxelizePlan::finishes_on_cpu()).
  virtual Status run_tiles(std::span<const TileBin> bins, std::vector<SparseTile>& tiles) = 0;
  // Frees what only the job needed; also after an error.
  virtual void end_job() = 0;
  // Frees what the job kept for the next one of the same frames.
  virtual void end_frames() {}

  // Bytes on the device at the peak, textures at the levels that are used not counted.
  virtual int64_t device_bytes(const Scene& scene, const WantedChannels& channels) const = 0;
  virtual DeviceTraits traits() const = 0;
  // Tiles to hand to run_tiles() at a time: the step of progress and cancelling.
  virtual size_t batch_tiles() const { return 1; }
};

}  // namespace voxeld
