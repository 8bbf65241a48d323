// One request on its way from scene to grid, tile by tile: inside of voxelize.cpp.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/gpu/pass_timer.h"
#include "server/voxel/attribute_pass.h"
#include "server/voxel/attribute_records.h"
#include "server/voxel/bin.h"
#include "server/voxel/estimate.h"
#include "server/voxel/resolve.h"
#include "server/voxel/snap.h"
#include "server/voxel/tile_device.h"
#include "server/voxel/tile_window.h"
#include "server/voxel/touch_pass.h"
#include "server/voxel/voxelize.h"

namespace voxeld {

// What a Voxelizer keeps between requests: programs, buffers, and memory of the current tile.
struct VoxelizerState {
  VoxelizerState(gpu::Context& gpu_context, gpu::ShaderLibrary& shaders);

  gpu::Context* context;
  TileDevice device;
  TouchPass touch;
  AttributePass attributes;
  int64_t host_bytes_max;
  TileWindow window;
  std::vector<uint32_t> mask, word_offsets;  // of the tile
  std::vector<uint32_t> words;               // attributes of the window
  std::vector<uint32_t> sums, carries;
};

class VoxelizeJob {
 public:
  VoxelizeJob(VoxelizerState& state, const Scene& scene, const VoxelizeOptions& options,
              const TileProgress& progress, VoxelizeStats& stats);
  Result<Grid> run();

 private:
  void choose_pipeline();
  Status prepare();
  Status run_tile(const TileBin& bin);
  Status fill_and_upload(const TileBin& bin, size_t first, size_t& end);
  Status touch_tile(const TileBin& bin, uint64_t& blocks, bool& is_one_window);
  Status sum_attributes(const TileBin& bin, size_t voxel_count, bool is_one_window,
                        SparseTile& tile);
  Status sum_windows(const TileBin& bin, bool is_one_window);
  void note(std::string_view pass, double ms) { add_stage(stats_.passes, pass, ms); }

  VoxelizerState& state_;
  const Scene& scene_;
  const VoxelizeOptions& options_;
  const TileProgress& progress_;
  VoxelizeStats& stats_;
  gpu::PassTimer timer_;
  WantedChannels channels_;
  glm::dmat4 world_from_file_{1.0};
  SnappedMesh mesh_;
  std::optional<AttributeRecords> records_;
  std::vector<int> part_images_;
  Grid grid_;
};

}  // namespace voxeld
