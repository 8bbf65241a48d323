#include "server/voxel/voxelize.h"

#include <algorithm>

#include "server/base/stopwatch.h"
#include "server/voxel/cpu/cpu_pipeline.h"
#include "server/voxel/estimate.h"

namespace voxeld {
namespace {

struct Choice {
  Pipeline pipeline;
  std::string reason;
};

Choice choose(PipelineChoice asked, const TilePipeline* device) {
  switch (asked) {
    case PipelineChoice::kRaster:
      return {Pipeline::kRaster, "asked for"};
    case PipelineChoice::kCompute:
      return {Pipeline::kCompute, "asked for"};
    case PipelineChoice::kCpu:
      return {Pipeline::kCpu, "asked for"};
    case PipelineChoice::kAuto:
      break;
  }
  if (device == nullptr) return {Pipeline::kCpu, "cpu: there is no GL context"};
  if (device->traits().is_software) {
    return {Pipeline::kCpu,
            "cpu: the device is a software driver, which would run shaders on the same cores"};
  }
  return {Pipeline::kCompute,
          "compute: the device is hardware, and hardware for data centres has few units that "
          "rasterize"};
}

Status run_tiles(TilePipeline& pipeline, const VoxelizePlan& plan, std::span<const TileBin> bins,
                 const TileProgress& progress, VoxelizeStats& stats, TileSink& sink) {
  VOXELD_TRY(pipeline.begin_job(plan, stats));
  for (size_t done = 0;;) {
    if (progress && !progress(static_cast<int64_t>(done), static_cast<int64_t>(bins.size()))) {
      return Error{ErrorCode::kCancelled, "the job was cancelled while it was voxelized", "", ""};
    }
    if (done == bins.size()) return {};
    const size_t count = std::min(pipeline.batch_tiles(), bins.size() - done);
    std::vector<SparseTile> tiles;
    VOXELD_TRY(pipeline.run_tiles(bins.subspan(done, count), tiles));
    for (SparseTile& tile : tiles) canonicalize(tile);
    VOXELD_TRY(sink.add(std::move(tiles)));
    done += count;
  }
}

}  // namespace

struct Voxelizer::Impl {
  Impl(std::unique_ptr<TilePipeline> device_pipeline, int cpu_threads)
      : device(std::move(device_pipeline)), cpu(cpu_threads) {}

  std::unique_ptr<TilePipeline> device;
  CpuPipeline cpu;
  int64_t host_bytes_max = default_host_bytes_max();

  DeviceTraits traits() const { return device ? device->traits() : DeviceTraits(); }
  // Null where a device is needed and missing.
  TilePipeline* pipeline(Pipeline which) { return which == Pipeline::kCpu ? &cpu : device.get(); }
  Status plan_job(const Scene& scene, const VoxelizeOptions& options, bool keeps_tiles,
                  VoxelizePlan& plan, VoxelizeStats& stats) const;
};

// From the scene to snapped triangles, and whether the result will fit.
Status Voxelizer::Impl::plan_job(const Scene& scene, const VoxelizeOptions& options,
                                 bool keeps_tiles, VoxelizePlan& plan, VoxelizeStats& stats) const {
  Stopwatch watch;
  VOXELD_ASSIGN(const Placed placed, place_scene(scene, options));
  plan.spec = placed.spec;
  plan.world_from_file = placed.world_from_file;
  add_stage(stats.passes, "place", watch.lap());
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), host_bytes_max));
  const int64_t bytes_left = host_bytes_max - mesh_bytes(scene);
  VOXELD_ASSIGN(plan.mesh, snap_scene(scene, placed.world_from_file, placed.spec, bytes_left));
  // A close estimate takes its time, and matters only to grids that might not fit.
  if (keeps_tiles && dense_result_bytes(placed.spec, plan.channels) > bytes_left) {
    VOXELD_TRY(check_host_bytes(
        placed.spec, mesh_bytes(scene) + result_bytes(plan.mesh, placed.spec, plan.channels),
        host_bytes_max));
  }
  stats.triangles = static_cast<int64_t>(plan.mesh.triangles.size());
  add_stage(stats.passes, "snap", watch.lap());
  for (size_t part = 0; part < scene.parts.size(); ++part) {
    const bool sampled = plan.channels.color && options.color != ColorMode::kAxis;
    plan.part_images.push_back(sampled ? part_image(scene, part) : -1);
  }
  if (!plan.channels.any()) return {};
  plan.records.emplace(scene, plan.mesh, plan.spec, plan.world_from_file, options.color,
                       plan.channels.summed, traits().texture_side_max);
  add_stage(stats.passes, "levels", watch.lap());
  return {};
}

Voxelizer::Voxelizer(std::unique_ptr<TilePipeline> device, int cpu_threads)
    : impl_(std::make_unique<Impl>(std::move(device), cpu_threads)) {}
Voxelizer::~Voxelizer() = default;

Result<Grid> Voxelizer::voxelize(const Scene& scene, const VoxelizeOptions& options,
                                 const TileProgress& progress, VoxelizeStats* stats) {
  Grid grid;
  GridSink sink(grid);
  VOXELD_TRY(voxelize(scene, options, sink, progress, stats));
  return grid;
}

Status Voxelizer::voxelize(const Scene& scene, const VoxelizeOptions& options, TileSink& sink,
                           const TileProgress& progress, VoxelizeStats* stats) {
  VoxelizeStats unwanted;
  if (stats == nullptr) stats = &unwanted;
  const Choice choice = choose(options.pipeline, impl_->device.get());
  stats->pipeline = choice.pipeline;
  stats->pipeline_reason = choice.reason;
  TilePipeline* pipeline = impl_->pipeline(choice.pipeline);
  if (pipeline == nullptr) {
    return Error{ErrorCode::kDeviceUnavailable,
                 "pipeline " + std::string(pipeline_name(choice.pipeline)) +
                     " needs a GL context, and this device has none",
                 "pipeline=cpu or auto", std::string(pipeline_name(choice.pipeline))};
  }
  VoxelizePlan plan{scene, options, wanted_channels(scene, options)};
  VOXELD_TRY(impl_->plan_job(scene, options, sink.keeps_tiles(), plan, *stats));
  Grid grid;
  grid.spec = plan.spec;
  grid.has_color = plan.channels.color;
  grid.has_normal = plan.channels.normal;
  VOXELD_TRY(sink.begin(grid));
  Stopwatch watch;
  const TileBins bins(plan.mesh, plan.spec.tile_dims());
  add_stage(stats->passes, "bin", watch.lap());
  const Status done = run_tiles(*pipeline, plan, bins.bins(), progress, *stats, sink);
  pipeline->end_job();
  return done;
}

Result<VoxelizeEstimate> Voxelizer::estimate(const Scene& scene,
                                             const VoxelizeOptions& options) const {
  VOXELD_ASSIGN(const Placed placed, place_scene(scene, options));
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), impl_->host_bytes_max));
  VOXELD_ASSIGN(const SnappedMesh mesh, snap_scene(scene, placed.world_from_file, placed.spec,
                                                   impl_->host_bytes_max - mesh_bytes(scene)));
  const WantedChannels channels = wanted_channels(scene, options);
  const Choice choice = choose(options.pipeline, impl_->device.get());
  const TilePipeline* pipeline = impl_->pipeline(choice.pipeline);
  VoxelizeEstimate estimate;
  estimate.spec = placed.spec;
  estimate.tiles = static_cast<int64_t>(TileBins(mesh, placed.spec.tile_dims()).bins().size());
  if (pipeline != nullptr) estimate.device_bytes = pipeline->device_bytes(scene, channels);
  estimate.host_bytes = mesh_bytes(scene) + result_bytes(mesh, placed.spec, channels);
  VOXELD_TRY(check_host_bytes(placed.spec, estimate.host_bytes, impl_->host_bytes_max));
  return estimate;
}

void Voxelizer::set_host_bytes_max(int64_t bytes) {
  impl_->host_bytes_max = bytes;
}

}  // namespace voxeld
