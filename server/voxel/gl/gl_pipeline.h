// Pipelines `raster` and `compute`: the mask and sums of a tile in buffers of a GL context.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/gpu/context.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/attribute_pass.h"
#include "server/voxel/gl/occupancy/batch_bricks.h"
#include "server/voxel/gl/occupancy/batch_touch.h"
#include "server/voxel/gl/occupancy/dispatch_pace.h"
#include "server/voxel/gl/occupancy/gl_tuning.h"
#include "server/voxel/gl/occupancy/tile_device.h"
#include "server/voxel/gl/occupancy/touch_pass.h"
#include "server/voxel/gl/occupancy/word_touch.h"
#include "server/voxel/gl/skin/skin_pass.h"
#include "server/voxel/gl/solid/gl_flood.h"
#include "server/voxel/gl/solid/gl_inside.h"
#include "server/voxel/pipelines/device_skin.h"
#include "server/voxel/pipelines/tile_pipeline.h"
#include "server/voxel/triangles/tile_window.h"

namespace voxeld {

// Runs either pipeline; the job's stats.pipeline says which. Pipeline compute has three ways to the
// same bytes. The first is batches of tiles (GlTuning). The others handle windows of one tile
// prepared on the CPU, and words of the mask (WordTouch) for rule touch without attributes.
class GlPipeline final : public TilePipeline, public DeviceInside, public DeviceSkin {
 public:
  GlPipeline(gpu::Context& context, gpu::ShaderLibrary& shaders, const GlTuning& tuning = {});

  Status begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) override;
  Status run_tiles(std::span<const TileBin> bins, const Pause& pause,
                   std::vector<SparseTile>& tiles) override;
  void end_job() override;
  void end_frames() override;
  int64_t device_bytes(const Scene& scene, const WantedChannels& channels) const override;
  DeviceTraits traits() const override;
  size_t batch_tiles() const override;

  Status find_inside(const InsideJob& job, const ColumnProgress& progress,
                     std::vector<SparseTile>& tiles, AxisVotes& votes,
                     VoxelizeStats& stats) override;
  Result<bool> flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                            const ColumnProgress& progress, std::vector<SparseTile>& tiles,
                            VoxelizeStats& stats) override;
  int64_t inside_bytes(const glm::ivec3& dims, Sign sign) const override;

  // Only for batches of pipeline compute.
  Result<bool> can_skin(const SkinnedFrames& frames) override;
  Result<bool> skin(const SkinFrame& frame, VoxelizeStats& stats) override;
  void read_vertices(std::span<glm::ivec3> q) const override;
  void read_positions(size_t first, std::span<glm::dvec3> positions) const override;

 private:
  // Properties of the current job.
  bool is_batched() const;
  bool is_by_words() const;
  Status run_bins(std::span<const TileBin> bins, std::vector<SparseTile>& tiles);
  Status run_batch(std::span<const TileBin> bins, std::vector<SparseTile>& tiles);
  Status add_attributes(const TileBin& bin, size_t slot, SparseTile& tile);
  Status run_words(std::span<const TileBin> bins, std::vector<SparseTile>& tiles);
  Status touch_words(std::span<const TilePart> parts, std::span<uint64_t> blocks);
  Status run_tile(const TileBin& bin, std::vector<SparseTile>& tiles);
  Status fill_and_upload(const TileBin& bin, size_t first, size_t& end);
  Status touch_windows(const TileBin& bin, uint64_t& blocks, bool& is_one_window);
  Status sum_attributes(const TileBin& bin, size_t voxel_count, bool is_one_window,
                        SparseTile& tile);
  // Resolves the voxels [first, first + count).
  Status resolve_sums(const TileBin& bin, size_t first, size_t count, bool is_one_window,
                      SparseTile& tile);
  // Finds the id with the largest weight in each of these voxels.
  Status fold_ids(const TileBin& bin, const IdChannel& channel, size_t first, size_t count,
                  SparseTile& tile);
  Status sum_alone(const TileBin& bin, const IdChannel& channel, uint16_t id, size_t first,
                   size_t count);
  Status sum_windows(const TileBin& bin, bool is_one_window);
  void note(std::string_view pass, double ms) { add_stage(stats_->passes, pass, ms); }

  gpu::Context* context_;
  GlTuning tuning_;
  DispatchPace pace_;
  TileDevice device_;
  TouchPass touch_;
  WordTouch word_touch_;
  AttributePass attributes_;
  BatchTouch batch_touch_;
  BatchBricks batch_bricks_;
  GlInside inside_;
  GlFlood flood_;
  SkinPass skin_;
  const gpu::Buffer* skinned_ = nullptr;  // q of the last skin()
  // State of the current job.
  const VoxelizePlan* plan_ = nullptr;
  VoxelizeStats* stats_ = nullptr;
  std::optional<gpu::PassTimer> timer_;
  // State of the current tile.
  TileWindow window_;
  std::vector<uint32_t> mask_, word_offsets_;
  std::vector<uint32_t> words_;  // attributes of the window
  std::vector<uint32_t> sums_, carries_;
  IdFold fold_;
};

}  // namespace voxeld
