#include "server/voxel/voxelize.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/clock.h"
#include "server/voxel/attributes/part_ids.h"
#include "server/voxel/cpu/cpu_pipeline.h"
#include "server/voxel/estimates/estimate.h"
#include "server/voxel/frames/frame_vertices.h"
#include "server/voxel/pipelines/device_faults.h"
#include "server/voxel/pipelines/fallback.h"
#include "server/voxel/solid/auto_sign.h"
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

// The state of a surface that is made bin by bin.
struct SurfaceRun {
  size_t done;                       // bins whose tiles were handed over
  bool has_pipeline_failed = false;  // rather than whoever takes the tiles
};

// Runs the bins from `run.done` on and hands tiles over as they come. finisher: completes a
// device's tiles on the CPU; null if there is nothing to complete.
Status run_tiles(TilePipeline& pipeline, CpuPipeline* finisher, const VoxelizePlan& plan,
                 std::span<const TileBin> bins, SurfaceRun& run, const Steps& steps,
                 VoxelizeStats& stats, const TakeTiles& take) {
  const auto of_pipeline = [&](Status status) {
    run.has_pipeline_failed = !status.ok();
    return status;
  };
  VOXELD_TRY(of_pipeline(pipeline.begin_job(plan, stats)));
  if (finisher != nullptr) VOXELD_TRY(finisher->begin_job(plan, stats));
  VOXELD_TRY(steps.surface_done(run.done));
  while (run.done < bins.size()) {
    const size_t count = std::min(pipeline.batch_tiles(), bins.size() - run.done);
    const std::span<const TileBin> batch = bins.subspan(run.done, count);
    std::vector<SparseTile> tiles;
    const int64_t tiles_before = stats.tiles;
    const auto pause = [&] { return steps.surface_done(run.done); };
    const Status ran = of_pipeline(pipeline.run_tiles(batch, pause, tiles));
    if (!ran) stats.tiles = tiles_before;
    VOXELD_TRY(ran);
    if (finisher != nullptr) finisher->finish_tiles(batch, tiles);
    run.done += count;
    // Before the tiles are taken: a job that is preempted there says how far it got.
    VOXELD_TRY(steps.surface_done(run.done));
    VOXELD_TRY(take(std::move(tiles), run.done));
  }
  return {};
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
  InsideFinder inside_finder{cpu.team()};
  int64_t host_bytes_max = default_host_bytes_max();
  CalibrationLookup calibration;
  DeviceFaults faults;

  DeviceTraits traits() const { return device ? device->traits() : DeviceTraits(); }
  // Null if the pipeline needs a device and there is none.
  TilePipeline* pipeline(Pipeline which) { return which == Pipeline::kCpu ? &cpu : device.get(); }
  PipelineDecision decide(PipelineChoice asked, const Workload& work,
                          const WantedChannels& channels) const;
  Status check_asked(PipelineChoice asked) const;
  Status check_faults(PipelineChoice asked, const WantedChannels& channels) const;
  Status plan_job(const Scene& scene, const VoxelizeOptions& options, SharedFrames* frames,
                  bool keeps_tiles, const TileProgress& progress, VoxelizePlan& plan,
                  VoxelizeStats& stats) const;
  // Makes the plan's mesh. The device or the CPU first moves the vertices of a frame. If
  // `wants_vertices`, vertices that the device moved are read back.
  Status snap_mesh(SharedFrames* frames, bool wants_vertices, VoxelizePlan& plan,
                   VoxelizeStats& stats) const;
  // Snaps the plan's scene, within the memory that mesh_bytes() leaves.
  Status snap(VoxelizePlan& plan) const;
  // Chooses the pipeline that makes the surface of the bins.
  Result<Pipeline> choose(const VoxelizePlan& plan, std::span<const TileBin> bins,
                          SharedFrames* frames, VoxelizeStats& stats) const;
  // Makes the plan's tiles and hands them to the sink.
  Status run_plan(VoxelizePlan& plan, SharedFrames* frames, TileSink& sink,
                  const TileProgress& progress, VoxelizeStats& stats);
  // Makes the surface from bin `first` on. `take` gets the tiles as they come. Where the device
  // fails and may_fall_back(), the CPU makes the rest.
  Status run_surface(TilePipeline& pipeline, VoxelizePlan& plan, SharedFrames* frames,
                     std::span<const TileBin> bins, size_t first, const Steps& steps,
                     VoxelizeStats& stats, const TakeTiles& take);
  // Runs one job of the pipeline.
  Status run_job(TilePipeline& pipeline, const VoxelizePlan& plan, std::span<const TileBin> bins,
                 SurfaceRun& run, const Steps& steps, VoxelizeStats& stats, const TakeTiles& take);
  // Makes the vertices of a frame that are on the device alone.
  Status take_vertices_from_device(SharedFrames& frames, VoxelizePlan& plan) const;
  Status run_solid(TilePipeline& pipeline, VoxelizePlan& plan, SharedFrames* frames,
                   const TileBins& bins, TileSink& sink, const TileProgress& progress,
                   VoxelizeStats& stats);
  // The device that fills inside a surface from pipeline `which`; null: the CPU fills. `auto` on a
  // software driver fills on the CPU, because the driver would run shaders on the same cores.
  // Crossings need 64-bit integers in shaders.
  DeviceInside* inside_of(Pipeline which, PipelineChoice asked) const {
    const DeviceTraits of_device = traits();
    const bool is_slow = asked == PipelineChoice::kAuto && of_device.is_software;
    const bool fills = which != Pipeline::kCpu && !is_slow && of_device.has_int64 &&
                       !faults.has(DevicePart::kSolid);
    return fills ? device_inside : nullptr;
  }
  // An upper estimate of the job's host memory. Errors: grid-too-large.
  Result<int64_t> job_bytes(const Scene& scene, const SnappedMesh& mesh, const Placed& placed,
                            const VoxelizeOptions& options, const WantedChannels& channels) const;
};

Result<int64_t> Voxelizer::Impl::job_bytes(const Scene& scene, const SnappedMesh& mesh,
                                           const Placed& placed, const VoxelizeOptions& options,
                                           const WantedChannels& channels) const {
  const SurfaceSize surface = surface_size(mesh, placed.spec);
  const int64_t surface_bytes = surface.bytes(channels);
  int64_t bytes = mesh_bytes(scene) + surface_bytes +
                  fill_bytes(mesh, placed.spec, options, surface_bytes, cpu.threads());
  if (channels.volume) {
    bytes += coverage_bytes(placed.spec, surface.bytes(WantedChannels()), cpu.threads());
  }
  const bool needs_sign = channels.grid.distance || options.has_inside();
  if (needs_sign && options.sign == Sign::kAuto) {
    bytes += auto_sign_bytes(placed.spec.dims, surface.bytes(WantedChannels()));
  }
  bytes += tree_bytes(options, static_cast<int64_t>(scene.triangle_count()));
  if (options.needs_whole_surface()) bytes += FillMesh::own_bytes(scene, mesh);
  // The cells of a band are estimated by that mesh, which is made for it.
  VOXELD_TRY(check_host_bytes(placed.spec, bytes, host_bytes_max));
  bytes += distance_bytes(scene, mesh, placed, options, channels);
  VOXELD_TRY(check_host_bytes(placed.spec, bytes, host_bytes_max));
  return bytes;
}

PipelineDecision Voxelizer::Impl::decide(PipelineChoice asked, const Workload& work,
                                         const WantedChannels& channels) const {
  const DeviceTraits of_device = traits();
  return decide_pipeline(asked, {device ? &of_device : nullptr, calibration, &faults}, work,
                         channels.any());
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

// Refuses a pipeline that would make other bytes.
Status Voxelizer::Impl::check_faults(PipelineChoice asked, const WantedChannels& channels) const {
  const auto named = asked_pipeline(asked);
  if (!named || *named == Pipeline::kCpu) return {};
  const DevicePart part = surface_part(*named, channels.any());
  if (!faults.has(part)) return {};
  const std::string name(pipeline_name(*named));
  return Error{ErrorCode::kUnsupportedFeature,
               "pipeline " + name + " failed the device's self-test (" + faults.why(part) + ")",
               "pipeline=cpu or auto", name};
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
  plan.calibration = calibration.found ? &calibration.calibration : nullptr;
  add_stage(stats.passes, "place", watch.lap());
  VOXELD_TRY(check_host_bytes(placed.spec, mesh_bytes(scene), host_bytes_max));
  if (plan.channels.volume) VOXELD_TRY(check_coverage_dims(placed.spec.dims));
  if (plan.channels.grid.distance) VOXELD_TRY(check_distance_unit(placed.spec, options.distance));
  const int64_t bytes_left = host_bytes_max - mesh_bytes(scene);
  // A close estimate takes time, so it is made only for grids that might not fit.
  const bool fills = options.needs_whole_surface();
  const bool estimates =
      keeps_tiles && (fills || dense_result_bytes(placed.spec, plan.channels) > bytes_left);
  VOXELD_TRY(between_steps(progress));
  VOXELD_TRY(snap_mesh(frames, estimates, plan, stats));
  VOXELD_TRY(between_steps(progress));
  if (plan.keeps_inside && frames == nullptr) {
    const bool is_mirrored = glm::determinant(glm::dmat3(plan.world_from_file)) < 0;
    settle_faces(plan.spec.dims, is_mirrored, plan.mesh);
  }
  if (estimates) VOXELD_TRY(job_bytes(scene, plan.mesh, placed, options, plan.channels));
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

Status Voxelizer::Impl::snap_mesh(SharedFrames* frames, bool wants_vertices, VoxelizePlan& plan,
                                  VoxelizeStats& stats) const {
  if (frames != nullptr) {
    plan.mesh = frames->take_mesh();
    const bool bins_tiles = plan.spec.tile_dims() != glm::ivec3(1);
    const auto skinned =
        skin_frame(device_skin, *frames, wants_vertices || bins_tiles, plan, stats);
    if (!skinned) {
      if (!may_fall_back(plan.options, skinned.error())) return skinned.error();
      record_fallback(skinned.error(), stats);
      frames->set_device_moves(false);
    }
    plan.has_device_vertices = skinned.ok() && *skinned;
    if (!plan.has_device_vertices) VOXELD_TRY(frames->move_vertices());
  }
  if (!plan.has_device_vertices) VOXELD_TRY(snap(plan));
  if (frames != nullptr && plan.mesh.is_whole) plan.mesh_key = frames->mesh_key();
  return {};
}

Status Voxelizer::Impl::snap(VoxelizePlan& plan) const {
  const int64_t bytes_max = host_bytes_max - mesh_bytes(plan.scene);
  VOXELD_ASSIGN(plan.mesh, snap_scene(plan.scene, plan.world_from_file, plan.spec, bytes_max,
                                      std::move(plan.mesh)));
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
  const auto moves = may_skin_frames(device_skin, *frames, plan, pipeline);
  if (!moves) {
    if (!may_fall_back(plan.options, moves.error())) return moves.error();
    record_fallback(moves.error(), stats);
  }
  frames->set_device_moves(moves.ok() && *moves);
  return stats.pipeline;
}

Status Voxelizer::Impl::run_surface(TilePipeline& pipeline, VoxelizePlan& plan,
                                    SharedFrames* frames, std::span<const TileBin> bins,
                                    size_t first, const Steps& steps, VoxelizeStats& stats,
                                    const TakeTiles& take) {
  SurfaceRun run{.done = first};
  stats.tiles += static_cast<int64_t>(first);
  Status made = run_job(pipeline, plan, bins, run, steps, stats, take);
  if (made || &pipeline == &cpu || !run.has_pipeline_failed ||
      !may_fall_back(plan.options, made.error())) {
    return made;
  }
  record_fallback(made.error(), stats);
  if (plan.has_device_vertices) VOXELD_TRY(take_vertices_from_device(*frames, plan));
  return run_job(cpu, plan, bins, run, steps, stats, take);
}

Status Voxelizer::Impl::run_job(TilePipeline& pipeline, const VoxelizePlan& plan,
                                std::span<const TileBin> bins, SurfaceRun& run, const Steps& steps,
                                VoxelizeStats& stats, const TakeTiles& take) {
  CpuPipeline* finisher = &pipeline != &cpu && plan.finishes_on_cpu() ? &cpu : nullptr;
  const auto end = [&] {
    pipeline.end_job();
    if (finisher != nullptr) finisher->end_job();
  };
  Status done;
  try {
    done = run_tiles(pipeline, finisher, plan, bins, run, steps, stats, take);
  } catch (...) {  // Cancelled, or no memory
    end();
    throw;
  }
  end();
  return done;
}

Status Voxelizer::Impl::take_vertices_from_device(SharedFrames& frames, VoxelizePlan& plan) const {
  frames.set_device_moves(false);
  VOXELD_TRY(frames.move_vertices());
  plan.has_device_vertices = false;
  return snap(plan);
}

// Makes all of the surface's tiles, then fills the inside.
Status Voxelizer::Impl::run_solid(TilePipeline& surface_pipeline, VoxelizePlan& plan,
                                  SharedFrames* frames, const TileBins& bins, TileSink& sink,
                                  const TileProgress& progress, VoxelizeStats& stats) {
  const std::vector<TileBin> no_bins;
  const std::vector<TileBin>& surface = plan.options.rule == Rule::kNone ? no_bins : bins.bins();
  const Steps steps(progress, surface.size(), tile_column_count(plan.spec.dims));
  std::vector<SparseTile> tiles;
  VOXELD_TRY(run_surface(surface_pipeline, plan, frames, surface, 0, steps, stats,
                         [&](std::vector<SparseTile> made, size_t) -> Status {
                           std::ranges::move(made, std::back_inserter(tiles));
                           return {};
                         }));
  DeviceInside* inside = inside_of(stats.pipeline, plan.options.pipeline);
  VOXELD_TRY(SolidFiller(inside_finder, host_bytes_max, inside)
                 .fill(
                     plan,
                     [&]() -> Result<std::vector<SparseTile>> {
                       return cpu.touch_tiles(plan.mesh, plan.spec, bins.bins());
                     },
                     [&](size_t columns) { return steps.fill_done(columns); }, tiles, stats));
  return sink.add(std::move(tiles));
}

Status Voxelizer::Impl::run_plan(VoxelizePlan& plan, SharedFrames* frames, TileSink& sink,
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
  if (plan.options.needs_whole_surface()) {
    return run_solid(*pipeline(chosen), plan, frames, bins, sink, progress, stats);
  }
  const size_t steps = bins.bins().size();
  VOXELD_ASSIGN(const size_t first, sink.resume(steps));
  return run_surface(*pipeline(chosen), plan, frames, bins.bins(), first, Steps(progress, steps, 0),
                     stats, [&](std::vector<SparseTile> tiles, size_t done) -> Status {
                       for (SparseTile& tile : tiles) {
                         cancel_point();
                         canonicalize(tile);
                       }
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
  const WantedChannels channels =
      frames != nullptr ? frames->channels(scene, options) : wanted_channels(scene, options);
  VoxelizeOptions of_surface = options;
  const bool keeps_inside = options.rule == Rule::kNone && options.has_inside() && channels.any();
  if (keeps_inside) of_surface.rule = Rule::kTouch;
  VoxelizePlan plan{scene, of_surface, channels};
  plan.keeps_inside = keeps_inside;
  VOXELD_TRY(impl_->check_faults(options.pipeline, plan.channels));
  const bool keeps_tiles = options.needs_whole_surface() || sink.keeps_tiles();
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
  if (channels.grid.distance) VOXELD_TRY(check_distance_unit(placed.spec, options.distance));
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
  VOXELD_ASSIGN(estimate.host_bytes, impl_->job_bytes(scene, mesh, placed, options, channels));
  estimate.tree_bytes = tree_bytes(options, static_cast<int64_t>(scene.triangle_count()));
  estimate.voxels = options.fill == Fill::kSurface ? surface_size(mesh, placed.spec).voxels
                                                   : placed.spec.cell_count();
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

void Voxelizer::set_device_faults(DeviceFaults faults) {
  impl_->faults = std::move(faults);
}

}  // namespace voxeld
