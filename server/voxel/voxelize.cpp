#include "server/voxel/voxelize.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "server/base/stopwatch.h"
#include "server/gpu/pass_timer.h"
#include "server/voxel/bin.h"
#include "server/voxel/compact.h"
#include "server/voxel/snap.h"
#include "server/voxel/tile_device.h"
#include "server/voxel/tile_window.h"
#include "server/voxel/touch_pass.h"

namespace voxeld {

std::string_view pipeline_name(Pipeline pipeline) {
  return pipeline == Pipeline::kRaster ? "raster" : "compute";
}

struct Voxelizer::Impl {
  Impl(gpu::Context& gpu_context, gpu::ShaderLibrary& shaders)
      : context(&gpu_context), device(gpu_context), touch(device, shaders), mask(kTileMaskWords) {}

  gpu::Context* context;
  TileDevice device;
  TouchPass touch;
  TileWindow window;           // kept between tiles for its memory
  std::vector<uint32_t> mask;  // of the current tile
};

namespace {

struct Placed {
  glm::dmat4 world_from_file{1.0};
  GridSpec spec;
};

Result<Placed> place(const Scene& scene, const VoxelizeOptions& options) {
  Placed placed;
  placed.world_from_file = world_from_file(options.placement);
  const Box3d box = world_bounds(scene, placed.world_from_file);
  if (box.empty()) {
    return Error{ErrorCode::kEmptyMesh, "the mesh has no triangles", "", ""};
  }
  VOXELD_ASSIGN(placed.spec, place_grid(options.placement, box.min, box.max));
  return placed;
}

}  // namespace

// One request on its way: the story of voxelize(), step by step.
class VoxelizeJob {
 public:
  VoxelizeJob(Voxelizer::Impl& impl, const Scene& scene, const VoxelizeOptions& options,
              const TileProgress& progress, VoxelizeStats& stats)
      : impl_(impl),
        scene_(scene),
        options_(options),
        progress_(progress),
        stats_(stats),
        timer_(*impl.context) {}

  Result<Grid> run() {
    choose_pipeline();
    Stopwatch watch;
    VOXELD_ASSIGN(const Placed placed, place(scene_, options_));
    grid_.spec = placed.spec;
    add_stage(stats_.passes, "place", watch.lap());
    VOXELD_ASSIGN(mesh_, snap_scene(scene_, placed.world_from_file, placed.spec));
    stats_.triangles = static_cast<int64_t>(mesh_.triangles.size());
    add_stage(stats_.passes, "snap", watch.lap());
    const TileBins bins(mesh_, placed.spec.tile_dims());
    add_stage(stats_.passes, "bin", watch.lap());
    for (size_t part = 0; part < scene_.parts.size(); ++part) {
      part_images_.push_back(part_image(scene_, part));
    }
    const auto total = static_cast<int64_t>(bins.bins().size());
    for (int64_t done = 0; done < total; ++done) {
      VOXELD_TRY(run_tile(bins.bins()[static_cast<size_t>(done)]));
      if (progress_ && !progress_(done + 1, total)) {
        return Error{ErrorCode::kCancelled, "the job was cancelled while voxelizing", "", ""};
      }
    }
    for (const auto& [pass, ms] : timer_.results()) add_stage(stats_.passes, pass, ms);
    return std::move(grid_);
  }

 private:
  void choose_pipeline() {
    stats_.pipeline =
        options_.pipeline == PipelineChoice::kRaster ? Pipeline::kRaster : Pipeline::kCompute;
    stats_.pipeline_reason = "asked for";
    if (options_.pipeline != PipelineChoice::kAuto) return;
    stats_.pipeline_reason = "auto";
  }

  // The next window of the bin, from triangle `first` on; returns its end.
  size_t fill_window(const TileBin& bin, size_t first) {
    const ItemSizes sizes{impl_.context->info().is_software ? VOXELIZE_BLOCK_COLUMNS : 4};
    size_t count = std::min(bin.triangles.size() - first, kWindowTrianglesMax);
    while (!fill_tile_window(mesh_, grid_.spec, bin.coord, bin.triangles.subspan(first, count),
                             part_images_, sizes, impl_.window)) {
      count = (count + 1) / 2;
    }
    return first + count;
  }

  Status run_tile(const TileBin& bin) {
    TileDevice& device = impl_.device;
    VOXELD_TRY(device.begin_tile(tile_cell_max(grid_.spec, bin.coord)));
    uint64_t blocks = 0;
    for (size_t first = 0; first < bin.triangles.size();) {
      Stopwatch watch;
      first = fill_window(bin, first);
      add_stage(stats_.passes, "items", watch.lap());
      stats_.work_items += static_cast<int64_t>(impl_.window.items.size());
      if (impl_.window.items.empty()) continue;
      VOXELD_TRY(device.upload_window(impl_.window, stats_.pipeline == Pipeline::kCompute));
      VOXELD_TRY(device.clear_mask(impl_.window.blocks));
      add_stage(stats_.passes, "upload", watch.lap());
      timer_.begin("occupancy");
      VOXELD_TRY(impl_.touch.run(impl_.window, stats_.pipeline));
      timer_.end();
      blocks |= impl_.window.blocks;
    }
    if (blocks == 0) return {};
    ++stats_.tiles;
    Stopwatch watch;
    device.read_mask(blocks, impl_.mask);
    add_stage(stats_.passes, "read", watch.lap());
    SparseTile tile;
    tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
    compact_mask(impl_.mask, blocks, tile, {});
    add_stage(stats_.passes, "compact", watch.lap());
    stats_.device_bytes_peak = std::max(stats_.device_bytes_peak, device.bytes());
    if (!tile.masks.empty()) grid_.tiles.push_back(std::move(tile));
    return {};
  }

  Voxelizer::Impl& impl_;
  const Scene& scene_;
  const VoxelizeOptions& options_;
  const TileProgress& progress_;
  VoxelizeStats& stats_;
  gpu::PassTimer timer_;
  SnappedMesh mesh_;
  std::vector<int> part_images_;
  Grid grid_;
};

Voxelizer::Voxelizer(gpu::Context& context, gpu::ShaderLibrary& shaders)
    : impl_(std::make_unique<Impl>(context, shaders)) {}
Voxelizer::~Voxelizer() = default;

Result<Grid> Voxelizer::voxelize(const Scene& scene, const VoxelizeOptions& options,
                                 const TileProgress& progress, VoxelizeStats* stats) {
  VoxelizeStats own;
  return VoxelizeJob(*impl_, scene, options, progress, stats != nullptr ? *stats : own).run();
}

Result<VoxelizeEstimate> Voxelizer::estimate(const Scene& scene,
                                             const VoxelizeOptions& options) const {
  VOXELD_ASSIGN(const Placed placed, place(scene, options));
  VoxelizeEstimate estimate;
  estimate.spec = placed.spec;
  return estimate;
}

}  // namespace voxeld
