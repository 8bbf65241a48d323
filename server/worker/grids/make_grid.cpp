#include "server/worker/grids/make_grid.h"

#include <string>
#include <utility>
#include <vector>

#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "server/voxel/estimates/estimate.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/grids/grid_input.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"
#include "server/worker/grids/tile_parts.h"
#include "server/worker/task/asset_input.h"
#include "server/worker/task/mesh_report.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// The placement of the grid: by its mesh, or that of all frames.
Result<Placed> place(const SceneInput& input, const VoxelizeOptions& options) {
  if (input.frames == nullptr) return place_scene(input.scene, options);
  return Placed{world_from_file(options.placement), input.frames->spec()};
}

}  // namespace

std::string render_key(const Task& task, const RequestOptions& options) {
  return scene_key(task, true) + " " + grid_options(options).dump() + " " +
         std::to_string(static_cast<int>(options.voxelize.pipeline));
}

Result<std::shared_ptr<const LoadedGrid>> load_input_grid(TaskRun& run) {
  const StageTimer stage(run, "parse");
  InputCache& cache = run.engine.cache;
  if (cache.grid == nullptr || cache.grid_key != run.task.input_hash) {
    cache.grid.reset();
    VOXELD_ASSIGN(const MappedFile file, MappedFile::open(run.task.input_path));
    VOXELD_ASSIGN(Grid grid, grid_from_container(file.bytes()));
    std::string hash = content_hash(grid);
    cache.grid = std::make_shared<const LoadedGrid>(LoadedGrid{std::move(grid), std::move(hash)});
    cache.grid_key = run.task.input_hash;
  }
  add_input_meta(run, cache.grid->grid.meta);
  VOXELD_TRY(run.monitor.check());
  return cache.grid;
}

NewContainers::NewContainers(TaskRun& run, const OutputOptions& asked)
    : run_(run),
      is_result_(asked.format == Format::kNative && !is_made_from_tiles(asked)),
      stored_(next_output(run), OutputOptions{}.codec),
      result_(next_output(run).string() + "-result", asked.codec),
      files_{&stored_} {
  const bool has_codec_of_stored = asked.codec == OutputOptions{}.codec;
  if (is_result_ && !has_codec_of_stored) files_.push_back(&result_);
}

Result<WrittenGrid> NewContainers::finish(const GridMeta& meta) {
  for (GridFile* file : files_) VOXELD_TRY(file->finish(meta));
  const std::string_view type = format_media_type(Format::kNative);
  const std::string_view extension = format_extension(Format::kNative);
  const bool has_other_result = files_.size() > 1;
  list_output(run_, stored_.path(), is_result_ && !has_other_result ? "grid result" : "grid", type,
              extension);
  if (has_other_result) list_output(run_, result_.path(), "result", type, extension);
  WrittenGrid written;
  written.path = stored_.path();
  VOXELD_ASSIGN(written.id, sha256_file_id(stored_.path()));
  VOXELD_TRY(run_.monitor.check());
  return written;
}

Result<WrittenGrid> voxelize_to_file(TaskRun& run, const SceneInput& input,
                                     const RequestOptions& options) {
  const Scene& scene = input.scene;
  const OutputOptions& asked = options.output;
  const bool is_kept = asked.format != Format::kNative && !is_made_from_tiles(asked);
  NewContainers containers(run, asked);
  TileParts parts(run);
  GridOutput output({containers.files().begin(), containers.files().end()}, is_kept,
                    kKeptTileBytesMax, &parts);
  const Stopwatch watch;
  run.monitor.set_stage("voxelize");
  VOXELD_ASSIGN(const Placed placed, place(input, options.voxelize));
  VOXELD_TRY(check_cells(run.task, placed.spec));
  VOXELD_ASSIGN(const GridSpec selected, selected_spec(placed.spec, asked));
  VOXELD_TRY(check_encodable(selected, asked));
  VOXELD_TRY(check_channels(wanted_channels(scene, options.voxelize).grid, asked));
  expect_bytes(run, voxelize_bytes(run.engine, scene, options, placed),
               run.engine.voxelizer.device_bytes(scene, options.voxelize));
  MeshReport mesh(run.engine.cache, input.key, scene);
  VoxelizeStats stats;
  Status made;
  {
    VOXELD_TRY(run.slice.begin());
    const DeviceSlice::Scope slice(run.slice);
    made = run.engine.voxelizer.voxelize(scene, options.voxelize, input.frames, output,
                                         progress_of(run), &stats);
  }
  note_device(run.engine, stats, made);
  add_stage(run.completion.timings, "voxelize", watch.ms() - output.encode_ms());
  add_stage(run.completion.timings, "encode", output.encode_ms());
  VOXELD_TRY(made);
  const StageTimer stage(run, "encode");
  const std::string hash = output.finish_hash();
  const GridMeta meta = container_meta(run.task, scene, grid_options(options),
                                       grid_facts(output.grid(), output.voxel_count(), hash),
                                       stats.fill, mesh.get(), options.voxelize.labels);
  add_making_meta(run, meta, stats);
  add_warnings(run, grid_warnings(options.voxelize, output.voxel_count(), stats));
  VOXELD_ASSIGN(WrittenGrid written, containers.finish(meta));
  if (output.has_tiles()) {
    written.kept = LoadedGrid{output.take_grid(), hash};
    written.kept->grid.meta = meta;
  }
  return written;
}

Status check_cells(const Task& task, const GridSpec& spec, size_t frames) {
  const int64_t cells = spec.cell_count();
  const auto count = static_cast<int64_t>(frames);
  if (task.cells_max <= 0 || cells <= task.cells_max / count) return {};
  std::string got = std::to_string(spec.dims.x) + " x " + std::to_string(spec.dims.y) + " x " +
                    std::to_string(spec.dims.z) + " = " + std::to_string(cells);
  if (count > 1) got += " in each of " + std::to_string(count) + " frames";
  return Error{ErrorCode::kGridTooLarge, "cells of one job, for this tenant",
               "at most " + std::to_string(task.cells_max), std::move(got)};
}

void keep_grid(TaskRun& run, WrittenGrid& made, const std::string& key) {
  run.engine.cache.grid = std::make_shared<const LoadedGrid>(std::move(*made.kept));
  run.engine.cache.grid_key = key;
}

Status check_one_grid(const AnimationOptions& options) {
  if (!options.frames) return {};
  return Error{ErrorCode::kInvalidOption, "frames: the input is one grid", "a sequence", "a grid"};
}

}  // namespace voxeld
