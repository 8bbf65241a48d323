#include "server/worker/grids/make_grid.h"

#include <string>
#include <utility>
#include <vector>

#include "server/base/file.h"
#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "server/grid/region.h"
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

Result<WrittenGrid> voxelize_to_file(TaskRun& run, const SceneInput& input,
                                     const RequestOptions& options) {
  const Scene& scene = input.scene;
  const OutputOptions& asked = options.output;
  const bool is_native = asked.format == Format::kNative;
  const bool is_selection = selects(asked);  // made from the file
  const bool is_result = is_native && !is_selection && asked.codec == OutputOptions{}.codec;
  const fs::path path = next_output(run);
  GridFile file(path, OutputOptions{}.codec);
  GridFile result(path.string() + "-result", asked.codec);
  std::vector<GridFile*> files = {&file};
  if (is_native && !is_selection && !is_result) files.push_back(&result);
  TileParts parts(run);
  GridOutput output(files, !is_native && !is_selection, kKeptTileBytesMax, &parts);
  const Stopwatch watch;
  run.monitor.set_stage("voxelize");
  VOXELD_ASSIGN(const Placed placed, place(input, options.voxelize));
  VOXELD_TRY(check_cells(run.task, placed.spec));
  VOXELD_ASSIGN(const GridSpec selected, selected_spec(placed.spec, asked));
  VOXELD_TRY(check_encodable(selected, asked));
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
  add_stage(run.completion.timings, "voxelize", watch.ms() - output.encode_ms());
  add_stage(run.completion.timings, "encode", output.encode_ms());
  VOXELD_TRY(made);
  const StageTimer stage(run, "encode");
  const std::string hash = output.finish_hash();
  const GridMeta meta = container_meta(run.task, scene, grid_options(options),
                                       grid_facts(output.grid(), output.voxel_count(), hash),
                                       stats.fill, mesh.get(), options.voxelize.labels);
  add_making_meta(run, meta, stats);
  for (GridFile* one : files) VOXELD_TRY(one->finish(meta));
  const std::string_view type = format_media_type(Format::kNative);
  const std::string_view extension = format_extension(Format::kNative);
  list_output(run, file.path(), is_result ? "grid result" : "grid", type, extension);
  if (files.size() > 1) list_output(run, result.path(), "result", type, extension);
  WrittenGrid written;
  written.path = file.path();
  VOXELD_ASSIGN(written.id, sha256_file_id(file.path()));
  if (output.has_tiles()) {
    written.kept = LoadedGrid{output.take_grid(), hash};
    written.kept->grid.meta = meta;
  }
  VOXELD_TRY(run.monitor.check());
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
