#include "server/voxel/voxelize.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

#include "server/base/clock.h"
#include "server/voxel/attributes/part_ids.h"
#include "server/voxel/cpu/cpu_pipeline.h"
#include "server/voxel/estimates/estimate.h"
#include "server/voxel/frames/frame_vertices.h"
#include "server/voxel/solid/coverage.h"
#include "server/voxel/solid/solid_filler.h"

namespace voxeld {
namespace {

// Called between the preparing steps, each of which scans the whole mesh. The callback can lend the
// device to other tasks there, and can cancel.
Status between_steps(const TileProgress& progress) {
  if (!progress || progress(0, 0)) return {};
  return Error{ErrorCode::kCancelled, "the job was cancelled while it was prepared", "", ""};
}

// Progress over the tiles of the surface, then over the columns of tiles that are filled.
class Steps {
 public:
  Steps(const TileProgress& progress, size_t tiles, size_t columns)
      : progress_(progress), tiles_(tiles), total_(tiles + columns) {}

  Status surface_done(size_t tiles) const { return done(tiles); }
  Status fill_done(size_t columns) const { return done(tiles_ + columns); }

 private:
  Status done(size_t count) const {
    if (!progress_ || progress_(static_cast<int64_t>(count), static_cast<int64_t>(total_))) {
      return {};
    }
    return Error{ErrorCode::kCancelled, "the job was cancelled while it was voxelized", "", ""};
  }

  const TileProgress& progress_;
  const size_t tiles_, total_;
};

// The id channels to compute, in the order of the channels.
Result<std::vector<IdChannel>> id_channels(const Scene& scene, const VoxelizeOptions& options,
                                           const ChannelSet& channels) {
  std::vector<IdChannel> list;
  for (const ChannelInfo& info : kChannels) {
    const bool chooses_ids =
        info.is_id() || (info.kind == ChannelKind::kColor && options.color == ColorMode::kDominant);
    if (!chooses_ids || !channels.has(info.channel)) continue;
    VOXELD_ASSIGN(IdChannel ids, id_channel(scene, info.channel, options.labels));
    list.push_back(std::move(ids));
  }
  return list;
}

// Receives tiles as the pipeline makes them. `done`: the number of bins that are finished.
using TakeTiles = std::function<Status(std::vector<SparseTile>, size_t done)>;

// Runs the bins from `done` on and hands tiles over as they come. finisher: completes a device's
// tiles on the CPU; null if there is nothing to complete.
Status run_tiles(TilePipeline& pipeline, CpuPipeline* finisher, const VoxelizePlan& plan,
                 std::span<const TileBin> bins, size_t done, const Steps& steps,
                 VoxelizeStats& stats, const TakeTiles& take) {
  VOXELD_TRY(pipeline.begin_job(plan, stats));
  if (finisher != nullptr) VOXELD_TRY(finisher->begin_job(plan, stats));
  stats.tiles += static_cast<int64_t>(done);
  for (;;) {
    VOXELD_TRY(steps.surface_done(done));
    if (done == bins.size()) return {};
    const size_t count = std::min(pipeline.batch_tiles(), bins.size() - done);
    std::vector<SparseTile> tiles;
    VOXELD_TRY(pipeline.run_tiles(bins.subspan(done, count), tiles));
    if (finisher != nullptr) finisher->finish_tiles(bins.subspan(done, count), tiles);
    done += count;
    VOXELD_TRY(take(std::move(tiles), done));
  }
}

// True if the whole surface is needed at once: for fills, and for the signs of distances.
bool needs_all_tiles(const VoxelizeOptions& options, const WantedChannels& channels) {
  return options.fill != Fill::kSurface || channels.grid.distance;
}

}  // namespace

struct Voxelizer::Impl {
  Impl(std::unique_ptr<TilePipeline> device_pipeline, int cpu_threads)
      : device(std::move(device_pipeline)),
        device_inside(dynamic_cast<DeviceInside*>(device.get())),
        device_skin(dynamic_cast<DeviceSkin*>(device.get())),
        cpu(cpu_threads) {}

  std::unique_ptr<TilePipeline> device;
  DeviceInside* device_inside;  // null: the device cannot find insides
  DeviceSkin* device_skin;      // null: the device cannot move vertices
  CpuPipeline cpu;
  int64_t host_bytes_max = default_host_bytes_max();
  CalibrationLookup calibration;

  DeviceTraits traits() const { return device ? device->traits() : DeviceTraits(); }
  // Null if the pipeline needs a device and there is none.
  TilePipeline* pipeline(Pipeline which) { return which == Pipeline::kCpu ? &cpu : device.get(); }
  PipelineDecision decide(PipelineChoice asked, const Workload& work,
                          const WantedChannels& channels) const;
  Status check_asked(PipelineChoice asked) const;
  Status plan_job(const Scene& scene, const VoxelizeOptions& options, SharedFrames* frames,
                  bool keeps_tiles, const TileProgress& progress, VoxelizePlan& plan,
                  VoxelizeStats& stats) const;
  // Makes the plan's mesh. The device or the CPU first moves the vertices of a frame. If
  // `wants_vertices`, vertices that the device moved are read back.
  Status snap_mesh(SharedFrames* frames, int64_t bytes_max, bool wants_vertices, VoxelizePlan& plan,
                   VoxelizeStats& stats) const;
  // Chooses the pipeline that makes the surface of the bins.
  Result<Pipeline> choose(const VoxelizePlan& plan, std::span<const TileBin> bins,
                          SharedFrames* frames, VoxelizeStats& stats) const;
  // Makes the plan's tiles and hands them to the sink.
  Status run_plan(const VoxelizePlan& plan, SharedFrames* frames, TileSink& sink,
                  const TileProgress& progress, VoxelizeStats& stats);
  // Runs one job of the pipeline, from bin `first` on. `take` gets the tiles as they come.
  Status run_surface(TilePipeline& pipeline, const VoxelizePlan& plan,
                     std::span<const TileBin> bins, size_t first, const Steps& steps,
                     VoxelizeStats& stats, const TakeTiles& take);
  Status run_solid(TilePipeline& pipeline, const VoxelizePlan& plan, const TileBins& bins,
                   TileSink& sink, const TileProgress& progress, VoxelizeStats& stats);
  // The device that fills inside a surface from pipeline `which`; null: the CPU fills. `auto` on a
  // software driver fills on the CPU, because the driver would run shaders on the same cores.
  DeviceInside* inside_of(Pipeline which, PipelineChoice asked) const {
    const bool is_slow = asked == PipelineChoice::kAuto && traits().is_software;
    return which == Pipeline::kCpu || is_slow ? nullptr : device_inside;
  }
  // An upper estimate of the job's host memory.
  int64_t job_bytes(const Scene& scene, const SnappedMesh& mesh, const Placed& placed,
                    const VoxelizeOptions& options, const WantedChannels& channels) const;
};

int64_t Voxelizer::Impl::job_bytes(const Scene& scene, const SnappedMesh& mesh,
                                   const Placed& placed, const VoxelizeOptions& options,
                                   const WantedChannels& channels) const {
  const SurfaceSize surface = surface_size(mesh, placed.spec);
  const int64_t surface_bytes = surface.bytes(channels);
  int64_t bytes = mesh_bytes(scene) + surface_bytes +
                  fill_bytes(mesh, placed.spec, options, surface_bytes, cpu.threads());
  if (channels.volume) {
    bytes += coverage_bytes(placed.spec, surface.bytes(WantedChannels()), cpu.threads());
  }
  return bytes + distance_bytes(FillMesh::of(scene, placed.world_from_file, placed.spec, mesh),
                                placed.spec, options, channels);
}

PipelineDecision Voxelizer::Impl::decide(PipelineChoice asked, const Workload& work,
                                         const WantedChannels& channels) const {
  const DeviceTraits of_device = traits();
  return decide_pipeline(asked, {device ? &of_device : nullptr, calibration}, work, channels.any());
}

// Refuses, before any work, a pipeline that this device does not have.
Status Voxelizer::Impl::check_asked(PipelineChoice asked) const {
  const auto named = asked_pipeline(asked);
  if (!named || *named == Pipeline::kCpu || device != nullptr) return {};
  return Error{ErrorCode::kUnsupportedFeature,
               "pipeline " + std::string(pipeline_name(*named)) +
                   " needs a GL context, and this device has none",
               "pipeline=cpu or auto", std::string(pipeline_name(*named))};
}

// Places the grid: by the mesh, or where all frames lie.
Result<Placed> place(const Scene& scene, const VoxelizeOptions& options,
                     const SharedFrames* frames) {
  if (frames == nullptr) return place_scene(scene, options);
  return Placed{world_from_file(options.placement), frames->spec()};
}

// Snaps the scene's triangles and checks that the result will fit.
Status Voxelizer::Impl::plan_job(const Scene& scene, const VoxelizeOptions& options,
                                 SharedFrames* frames, bool keeps_tiles,
                                 const TileProgress& progress, VoxelizePlan& plan,
                                 VoxelizeStats& stats) const {
  Stopwatch watch;
  VOXELD_ASSIGN(const Placed placed, place(scene, options, frames));
  plan.spec = placed.spec;
  plan.world_from_file = placed.world_from_file;
  add_stage(stats.passes, "place", watch.lap());
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), host_bytes_max));
  if (plan.channels.volume) VOXELD_TRY(check_coverage_dims(placed.spec.dims));
  const int64_t bytes_left = host_bytes_max - mesh_bytes(scene);
  // A close estimate takes time, so it is made only for grids that might not fit.
  const bool fills = needs_all_tiles(options, plan.channels);
  const bool estimates =
      keeps_tiles && (fills || dense_result_bytes(placed.spec, plan.channels) > bytes_left);
  VOXELD_TRY(between_steps(progress));
  VOXELD_TRY(snap_mesh(frames, bytes_left, estimates, plan, stats));
  VOXELD_TRY(between_steps(progress));
  if (estimates) {
    VOXELD_TRY(check_host_bytes(
        placed.spec, job_bytes(scene, plan.mesh, placed, options, plan.channels), host_bytes_max));
  }
  stats.triangles = static_cast<int64_t>(plan.mesh.triangles.size());
  add_stage(stats.passes, "snap", watch.lap());
  for (size_t part = 0; part < scene.parts.size(); ++part) {
    const bool sampled = plan.channels.grid.color && options.color != ColorMode::kAxis;
    plan.part_images.push_back(sampled ? part_image(scene, part) : -1);
  }
  if (!plan.channels.any()) return {};
  VOXELD_ASSIGN(plan.ids, id_channels(scene, options, plan.channels.grid));
  plan.records.emplace(scene, plan.mesh, plan.world_from_file, options.color,
                       plan.channels.recorded(), traits().texture_side_max,
                       frames != nullptr ? &frames->flat_colors() : nullptr);
  if (frames != nullptr) {
    frames->unite_levels(plan.records->image_levels());
    plan.textures_key = frames->textures_key();
  }
  add_stage(stats.passes, "levels", watch.lap());
  return between_steps(progress);
}

Status Voxelizer::Impl::snap_mesh(SharedFrames* frames, int64_t bytes_max, bool wants_vertices,
                                  VoxelizePlan& plan, VoxelizeStats& stats) const {
  if (frames != nullptr) {
    plan.mesh = frames->take_mesh();
    const bool bins_tiles = plan.spec.tile_dims() != glm::ivec3(1);
    VOXELD_ASSIGN(plan.has_device_vertices,
                  skin_frame(device_skin, *frames, wants_vertices || bins_tiles, plan, stats));
    if (!plan.has_device_vertices) VOXELD_TRY(frames->move_vertices());
  }
  if (!plan.has_device_vertices) {
    VOXELD_ASSIGN(plan.mesh, snap_scene(plan.scene, plan.world_from_file, plan.spec, bytes_max,
                                        std::move(plan.mesh)));
  }
  if (frames != nullptr && plan.mesh.is_whole) plan.mesh_key = frames->mesh_key();
  return {};
}

Result<Pipeline> Voxelizer::Impl::choose(const VoxelizePlan& plan, std::span<const TileBin> bins,
                                         SharedFrames* frames, VoxelizeStats& stats) const {
  SharedFrames::Choice choice;
  if (plan.has_device_vertices) {
    choice = *frames->choice();
  } else {
    choice.work = estimate_workload(plan.mesh, bins);
    choice.decision = decide(plan.options.pipeline, choice.work, plan.channels);
  }
  const Pipeline pipeline = choice.decision.pipeline;
  stats.work = choice.work;
  stats.pipeline = pipeline;
  stats.pipeline_reason = choice.decision.reason;
  if (frames == nullptr || plan.has_device_vertices) return pipeline;
  frames->set_choice(std::move(choice));
  VOXELD_ASSIGN(const bool moves, may_skin_frames(device_skin, *frames, plan, pipeline));
  frames->set_device_moves(moves);
  return pipeline;
}

Status Voxelizer::Impl::run_surface(TilePipeline& pipeline, const VoxelizePlan& plan,
                                    std::span<const TileBin> bins, size_t first, const Steps& steps,
                                    VoxelizeStats& stats, const TakeTiles& take) {
  CpuPipeline* finisher = &pipeline != &cpu && plan.finishes_on_cpu() ? &cpu : nullptr;
  Status done = run_tiles(pipeline, finisher, plan, bins, first, steps, stats, take);
  pipeline.end_job();
  if (finisher != nullptr) finisher->end_job();
  return done;
}

// Makes all of the surface's tiles, then fills the inside.
Status Voxelizer::Impl::run_solid(TilePipeline& surface_pipeline, const VoxelizePlan& plan,
                                  const TileBins& bins, TileSink& sink,
                                  const TileProgress& progress, VoxelizeStats& stats) {
  const std::vector<TileBin> no_bins;
  const std::vector<TileBin>& surface = plan.options.rule == Rule::kNone ? no_bins : bins.bins();
  const Steps steps(progress, surface.size(), tile_column_count(plan.spec.dims));
  std::vector<SparseTile> tiles;
  VOXELD_TRY(run_surface(surface_pipeline, plan, surface, 0, steps, stats,
                         [&](std::vector<SparseTile> made, size_t) -> Status {
                           std::ranges::move(made, std::back_inserter(tiles));
                           return {};
                         }));
  DeviceInside* inside = inside_of(stats.pipeline, plan.options.pipeline);
  VOXELD_TRY(SolidFiller(cpu.team(), host_bytes_max, inside)
                 .fill(
                     plan,
                     [&]() -> Result<std::vector<SparseTile>> {
                       return cpu.touch_tiles(plan.mesh, plan.spec, bins.bins());
                     },
                     [&](size_t columns) { return steps.fill_done(columns); }, tiles, stats));
  return sink.add(std::move(tiles));
}

Status Voxelizer::Impl::run_plan(const VoxelizePlan& plan, SharedFrames* frames, TileSink& sink,
                                 const TileProgress& progress, VoxelizeStats& stats) {
  Grid grid;
  grid.spec = plan.spec;
  grid.channels = plan.channels.grid;
  VOXELD_TRY(sink.begin(grid));
  Stopwatch watch;
  const TileBins bins(plan.mesh, plan.spec.tile_dims());
  add_stage(stats.passes, "bin", watch.lap());
  VOXELD_TRY(between_steps(progress));
  VOXELD_ASSIGN(const Pipeline chosen, choose(plan, bins.bins(), frames, stats));
  if (needs_all_tiles(plan.options, plan.channels)) {
    return run_solid(*pipeline(chosen), plan, bins, sink, progress, stats);
  }
  const size_t steps = bins.bins().size();
  VOXELD_ASSIGN(const size_t first, sink.resume(steps));
  return run_surface(*pipeline(chosen), plan, bins.bins(), first, Steps(progress, steps, 0), stats,
                     [&](std::vector<SparseTile> tiles, size_t done) -> Status {
                       for (SparseTile& tile : tiles) canonicalize(tile);
                       VOXELD_TRY(sink.add(std::move(tiles)));
                       return sink.reached(done);
                     });
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
  return voxelize(scene, options, nullptr, sink, progress, stats);
}

Status Voxelizer::voxelize(const Scene& scene, const VoxelizeOptions& options, SharedFrames* frames,
                           TileSink& sink, const TileProgress& progress, VoxelizeStats* stats) {
  VoxelizeStats unwanted;
  if (stats == nullptr) stats = &unwanted;
  VOXELD_TRY(impl_->check_asked(options.pipeline));
  VoxelizePlan plan{
      scene, options,
      frames != nullptr ? frames->channels(scene, options) : wanted_channels(scene, options)};
  const bool keeps_tiles = needs_all_tiles(options, plan.channels) || sink.keeps_tiles();
  VOXELD_TRY(impl_->plan_job(scene, options, frames, keeps_tiles, progress, plan, *stats));
  VOXELD_TRY(impl_->run_plan(plan, frames, sink, progress, *stats));
  if (frames != nullptr) frames->keep_mesh(std::move(plan.mesh));
  return {};
}

void Voxelizer::end_frames() {
  impl_->cpu.end_frames();
  if (impl_->device) impl_->device->end_frames();
}

Result<VoxelizeEstimate> Voxelizer::estimate(const Scene& scene,
                                             const VoxelizeOptions& options) const {
  VOXELD_ASSIGN(const Placed placed, place_scene(scene, options));
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), impl_->host_bytes_max));
  VOXELD_ASSIGN(const SnappedMesh mesh, snap_scene(scene, placed.world_from_file, placed.spec,
                                                   impl_->host_bytes_max - mesh_bytes(scene)));
  const WantedChannels channels = wanted_channels(scene, options);
  if (channels.volume) VOXELD_TRY(check_coverage_dims(placed.spec.dims));
  const TileBins bins(mesh, placed.spec.tile_dims());
  VoxelizeEstimate estimate;
  estimate.spec = placed.spec;
  estimate.tiles = static_cast<int64_t>(bins.bins().size());
  estimate.pipeline =
      impl_->decide(options.pipeline, estimate_workload(mesh, bins.bins()), channels);
  const TilePipeline* pipeline = impl_->pipeline(estimate.pipeline.pipeline);
  if (pipeline != nullptr) estimate.device_bytes = pipeline->device_bytes(scene, channels);
  const DeviceInside* inside = impl_->inside_of(estimate.pipeline.pipeline, options.pipeline);
  if (options.fill != Fill::kSurface && inside != nullptr) {
    estimate.device_bytes += inside->inside_bytes(placed.spec.dims, options.sign);
  }
  estimate.host_bytes = impl_->job_bytes(scene, mesh, placed, options, channels);
  estimate.voxels = options.fill == Fill::kSurface ? surface_size(mesh, placed.spec).voxels
                                                   : placed.spec.cell_count();
  VOXELD_TRY(check_host_bytes(placed.spec, estimate.host_bytes, impl_->host_bytes_max));
  return estimate;
}

int64_t Voxelizer::device_bytes(const Scene& scene, const VoxelizeOptions& options) const {
  const bool on_device = impl_->device && !impl_->traits().is_software &&
                         asked_pipeline(options.pipeline) != Pipeline::kCpu;
  return on_device ? impl_->device->device_bytes(scene, wanted_channels(scene, options)) : 0;
}

void Voxelizer::set_host_bytes_max(int64_t bytes) {
  impl_->host_bytes_max = bytes;
}

void Voxelizer::set_calibration(CalibrationLookup calibration) {
  impl_->calibration = std::move(calibration);
}

}  // namespace voxeld
