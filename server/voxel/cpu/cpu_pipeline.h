// Pipeline `cpu`: no GL, all cores, the machine's widest vectors.
#pragma once

#include <span>
#include <vector>

#include "server/base/simd/cpu_isa.h"
#include "server/voxel/cpu/attribute_tile.h"
#include "server/voxel/cpu/touch_tile.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

class CpuPipeline final : public TilePipeline {
 public:
  // threads: 0 means one per hardware thread. The instruction set must be supported.
  explicit CpuPipeline(int threads = 0, CpuIsa isa = best_cpu_isa());

  Status begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) override;
  Status run_tiles(std::span<const TileBin> bins, const Pause& pause,
                   std::vector<SparseTile>& tiles) override;
  void end_job() override;
  void end_frames() override { attributes_.end_frames(); }
  int64_t device_bytes(const Scene&, const WantedChannels&) const override { return 0; }
  DeviceTraits traits() const override { return {}; }
  size_t batch_tiles() const override;

  // Finishes what a device leaves to the CPU (VoxelizePlan::finishes_on_cpu()) in `tiles`, which it
  // made of `bins`. Needs a job of this pipeline that begins and ends with the device's.
  void finish_tiles(std::span<const TileBin> bins, std::span<SparseTile> tiles);

  // The tiles of `bins` by rule=touch, without attributes. The options of the current job do not
  // matter.
  std::vector<SparseTile> touch_tiles(const SnappedMesh& mesh, const GridSpec& spec,
                                      std::span<const TileBin> bins);
  ThreadTeam& team() { return touch_.team(); }
  int threads() const { return touch_.threads(); }

 private:
  void run_attributes(const TileBin& bin, SparseTile& tile);

  CpuTouch touch_;
  CpuAttributes attributes_;
  const VoxelizePlan* plan_ = nullptr;
  VoxelizeStats* stats_ = nullptr;
  std::vector<uint32_t> mask_, word_offsets_;  // scratch of the current tile
};

}  // namespace voxeld
