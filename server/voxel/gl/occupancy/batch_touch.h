// Pipeline compute on hardware: passes that find the occupied cells of a batch of tiles. The device
// itself sizes and feeds them (shaders/shared/voxelize_batch.h).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "proto/options/options.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/gl/occupancy/dispatch_pace.h"
#include "server/voxel/gl/occupancy/gl_tuning.h"
#include "server/voxel/gl/occupancy/resident_mesh.h"
#include "server/voxel/pipelines/tile_pipeline.h"
#include "shaders/shared/voxelize_batch.h"

namespace voxeld {

class BatchTouch {
 public:
  BatchTouch(const gpu::Context& context, gpu::ShaderLibrary& shaders, const GlTuning& tuning,
             const DispatchPace& pace);

  Status begin_job(const VoxelizePlan& plan);
  void end_job() { mesh_.end_job(); }
  void end_frames() { mesh_.end_frames(); }
  // The mesh's buffer, for passes that make vertices on the device: ResidentMesh::vertices().
  Result<const gpu::Buffer*> vertices(size_t count) { return mesh_.vertices(count); }

  // Number of tiles of one batch.
  size_t batch_tiles() const;
  // Makes the masks of the bins' tiles, slot after slot. At most batch_tiles() bins. If work items
  // do not fit, it runs again with larger lists or smaller windows.
  Status run(std::span<const TileBin> bins, gpu::PassTimer& timer);

  // The masks, kTileMaskBytes per slot.
  const gpu::Buffer& masks() const { return masks_; }
  // A BatchCounts, whose brick_count is 0 after run().
  const gpu::Buffer& counts() const { return counts_; }
  // Work items of the last run.
  int64_t item_count() const { return item_count_; }
  // Bytes of the mesh uploaded since begin_job().
  int64_t uploaded_bytes() const { return mesh_.uploaded_bytes(); }
  // Bytes of all buffers now.
  int64_t bytes() const;
  // An upper bound of bytes() for a job.
  int64_t bytes_max(size_t vertices, size_t triangles, size_t tiles) const;
  int64_t storage_bytes() const;

 private:
  struct Programs {
    const gpu::Program *classify, *small, *large;
  };
  Result<Programs> programs() const;
  // Runs window after window, until work items do not fit. The counts are those of the last one.
  Result<shared::BatchCounts> run_windows(std::span<const TileBin> bins, size_t pairs_max,
                                          const Programs& programs, gpu::PassTimer& timer);
  // Makes the work items of a window and takes as many of each list as one dispatch does.
  Status run_window(const PairWindow& window, bool is_first, const Programs& programs,
                    gpu::PassTimer& timer);
  // Takes the rest of a list, dispatch after dispatch.
  Status run_rest(const gpu::Buffer& items, size_t count, const gpu::Program& program,
                  std::string_view pass, gpu::PassTimer& timer);
  bool holds(const shared::BatchCounts& counts) const;
  Status upload_params(std::span<const TileBin> bins);

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  GlTuning tuning_;
  const DispatchPace* pace_;
  ResidentMesh mesh_;
  gpu::Buffer masks_, small_, large_, counts_, params_;
  shared::BatchParams values_{};
  Rule rule_ = Rule::kTouch;
  int64_t item_count_ = 0;
};

}  // namespace voxeld
