#include "server/worker/task_run.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <utility>

#include "proto/messages/bundle_manifest.h"
#include "proto/options/table.h"
#include "server/base/algorithm_version.h"
#include "server/base/file.h"
#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "server/grid/region.h"
#include "server/voxel/estimate.h"
#include "server/voxel/part_ids.h"
#include "server/worker/asset_input.h"
#include "server/worker/grid_file.h"
#include "server/worker/grid_input.h"
#include "server/worker/host_estimate.h"
#include "server/worker/inspect.h"
#include "server/worker/mesh_report.h"
#include "server/worker/tile_parts.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// Warnings listed. A hostile mesh can cause any number of them.
constexpr size_t kWarningsMax = 100;

// "models/bunny.ply" -> "bunny"; "bundle.zip!a/spot.obj" -> "spot"; "" -> "voxels"
std::string output_stem(const std::string& filename) {
  const size_t member = filename.rfind('!');
  const std::string name = member == std::string::npos ? filename : filename.substr(member + 1);
  const bool is_bundle = name.ends_with(kBundleExtension);
  const std::string stem = is_bundle ? name.substr(0, name.size() - kBundleExtension.size())
                                     : fs::path(name).stem().string();
  return stem.empty() ? "voxels" : stem;
}

json device_facts(const Engine& engine) {
  const gpu::DeviceInfo& info = engine.device.info;
  return {{"device", gpu::device_name(info.device)},
          {"renderer", info.renderer},
          {"driver", info.version}};
}

// Replaces the upload's name by "the mesh" where warnings have it: at the beginning, and after
// "named by".
std::string without_name(const std::string& text, std::string_view name) {
  constexpr std::string_view kNamedBy = ", named by ", kMesh = "the mesh";
  if (name.empty()) return text;
  std::string out;
  size_t done = 0;
  const auto replace_at = [&](size_t at) {
    const size_t end = at + name.size();
    if (text.compare(at, name.size(), name) != 0 || end >= text.size() ||
        std::string_view(":, ").find(text[end]) == std::string_view::npos) {
      return;
    }
    out.append(text, done, at - done).append(kMesh);
    done = end;
  };
  replace_at(0);
  for (size_t at = text.find(kNamedBy, done); at != std::string::npos;
       at = text.find(kNamedBy, std::max(done, at + kNamedBy.size()))) {
    replace_at(at + kNamedBy.size());
  }
  return out.append(text, done);
}

// Removes the upload's name from warnings. A container's id is the hash of its bytes, so it must
// not depend on the name.
json nameless_warnings(const std::vector<Warning>& warnings, const std::string& filename) {
  std::vector<Warning> nameless = warnings;
  for (Warning& warning : nameless) warning.detail = without_name(warning.detail, filename);
  return describe_warnings(nameless);
}

// The part of a container's meta that a response carries. Long lists of ids are cut, with their
// length; the container has them all. Tasks and their completions are JSON of at most 1 MiB.
json answer_meta(json meta) {
  meta.erase("warnings");  // a response has them beside its meta
  constexpr size_t kListBytesMax = size_t{100} << 10;
  for (const char* name : {"materials", "labels"}) {
    const auto list = meta.find(name);
    if (list == meta.end() || !list->is_array()) continue;
    size_t count = 0;
    for (size_t bytes = 0; count < list->size(); ++count) {
      bytes += (*list)[count].dump(-1, ' ', false, json::error_handler_t::replace).size();
      if (bytes > kListBytesMax) break;
    }
    if (count == list->size()) continue;
    const size_t total = list->size();
    list->erase(list->begin() + static_cast<std::ptrdiff_t>(count), list->end());
    meta[std::string(name) + "_total"] = total;
  }
  return meta;
}

// The placement of the grid: by its mesh, or that of all frames.
Result<Placed> place(const SceneInput& input, const VoxelizeOptions& options) {
  if (input.frames == nullptr) return place_scene(input.scene, options);
  return Placed{world_from_file(options.placement), input.frames->spec()};
}

TileProgress progress_of(TaskRun& run) {
  return [&run](int64_t done, int64_t total) {
    return run.monitor.set_progress(done, total) && run.slice.boundary();
  };
}

}  // namespace

Result<RequestOptions> task_options(const Task& task, OptionScope scope) {
  VOXELD_ASSIGN(const json object, parse_json_bounded(task.options_json));
  return parse_options(object, scope);
}

json grid_options(const RequestOptions& options) {
  json named = json::parse(canonical_json(options, OptionScope::kVoxelize), nullptr, false);
  for (const Option& option : option_table()) {
    const bool decides_grid = option.group == OptionGroup::kPlacement ||
                              option.group == OptionGroup::kVoxelization ||
                              option.group == OptionGroup::kAnimation;
    if (!decides_grid || option.name == "pipeline") named.erase(std::string(option.name));
  }
  return named;
}

json frame_grid_options(const RequestOptions& options) {
  json kept = grid_options(options);
  for (const Option& option : option_table()) {
    if (option.group == OptionGroup::kAnimation) kept.erase(std::string(option.name));
  }
  return kept;
}

std::string container_meta(const Task& task, const Scene& scene, const json& options,
                           const json& facts, const std::optional<FillStats>& fill,
                           const std::optional<MeshTopology>& topology, LabelKind labels) {
  json meta = {{"source_hash", task.input_hash},
               {"source_format", scene.format},
               {"source_triangles", scene.triangle_count()},
               {"units", options.value("units", "")},
               {"options", options},
               {"warnings", nameless_warnings(scene.warnings, task.filename)},
               {"algorithm_version", kAlgorithmVersion}};
  meta.update(facts);
  const json& channels = facts.at("channels");
  const auto has = [&](const char* channel) {
    return std::find(channels.begin(), channels.end(), json(channel)) != channels.end();
  };
  if (has("material")) meta["materials"] = describe_ids(id_names(scene, LabelKind::kMaterial));
  if (has("label")) meta["labels"] = describe_ids(id_names(scene, labels));
  meta["mesh"] = describe_mesh(topology, fill);
  if (fill) meta["solid"] = describe_fill(*fill, topology);
  return meta.dump(-1, ' ', false, json::error_handler_t::replace);
}

void add_making_meta(TaskRun& run, const std::string& container_meta, const VoxelizeStats& stats) {
  add_meta(run, answer_meta(json::parse(container_meta)));
  add_meta(run, device_facts(run.engine));
  add_meta(run, {{"triangles", stats.triangles},
                 {"tiles", stats.tiles},
                 {"pipeline", pipeline_name(stats.pipeline)},
                 {"pipeline_reason", stats.pipeline_reason},
                 {"device_bytes_peak", stats.device_bytes_peak}});
  json passes = json::object();
  for (const auto& [name, ms] : stats.passes) passes[name] = ms;
  add_meta(run, {{"passes_ms", passes}});
}

std::string render_key(const Task& task, const RequestOptions& options) {
  return scene_key(task, true) + " " + grid_options(options).dump() + " " +
         std::to_string(static_cast<int>(options.voxelize.pipeline));
}

void add_input_meta(TaskRun& run, const std::string& container_meta) {
  const json meta = json::parse(container_meta, nullptr, false);
  if (meta.is_object()) add_meta(run, answer_meta(meta));
  add_meta(run, device_facts(run.engine));
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
  add_input_meta(run, cache.grid->grid.meta_json);
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
  const std::string meta = container_meta(run.task, scene, grid_options(options),
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
    written.kept->grid.meta_json = meta;
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

Result<Picture> render_picture(TaskRun& run, const LoadedGrid& grid, const std::string& grid_key,
                               const RenderOptions& options) {
  const StageTimer stage(run, "render");
  VOXELD_ASSIGN(const Engine::ChosenRenderer by, run.engine.choose_renderer(options.renderer));
  VOXELD_TRY(run.slice.begin());
  const DeviceSlice::Scope slice(run.slice);
  if (*by.resident_key != grid_key) {
    by.resident_key->clear();
    VOXELD_TRY(by.renderer->set_grid(grid.grid));
    *by.resident_key = grid_key;
  }
  add_meta(run, {{"drawn_by", by.name}});
  return by.renderer->render(options, progress_of(run));
}

fs::path next_output(const TaskRun& run) {
  return run.scratch / (run.task.id + "-" + std::to_string(run.completion.outputs.size()));
}

void list_output(TaskRun& run, const fs::path& path, std::string_view roles,
                 std::string_view media_type, std::string_view extension) {
  while (!roles.empty()) {
    const std::string_view role = roles.substr(0, roles.find(' '));
    roles.remove_prefix(std::min(role.size() + 1, roles.size()));
    run.completion.outputs.push_back({std::string(role), path.string(), std::string(media_type),
                                      output_stem(run.task.filename) + std::string(extension)});
  }
}

Status add_output(TaskRun& run, std::string_view roles, std::span<const uint8_t> bytes,
                  std::string_view media_type, std::string_view extension) {
  const fs::path path = next_output(run);
  VOXELD_TRY(write_file(path, bytes));
  list_output(run, path, roles, media_type, extension);
  return run.monitor.check();
}

json grid_facts(const Grid& grid, uint64_t voxel_count, const std::string& content_hash) {
  json channels = json::array({"occupancy"});
  for (const ChannelInfo& info : kChannels) {
    if (grid.channels.has(info.channel)) channels.push_back(info.name);
  }
  const GridSpec& spec = grid.spec;
  return {{"dims", {spec.dims.x, spec.dims.y, spec.dims.z}},
          {"origin", {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z}},
          {"voxel_size", {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}},
          {"voxel_count", voxel_count},
          {"channels", channels},
          {"content_hash", content_hash}};
}

json grid_facts(const LoadedGrid& loaded) {
  return grid_facts(loaded.grid, loaded.grid.voxel_count(), loaded.content_hash);
}

void add_warnings(TaskRun& run, const std::vector<Warning>& warnings) {
  for (const Warning& warning : warnings) {
    if (run.completion.warnings.size() > kWarningsMax) return;
    if (run.completion.warnings.size() == kWarningsMax) {
      run.completion.warnings.push_back(
          {"more-warnings", "the first " + std::to_string(kWarningsMax) + " are listed"});
      return;
    }
    run.completion.warnings.push_back({warning.code, warning.detail.substr(0, kWarningBytesMax)});
  }
}

void add_meta(TaskRun& run, const json& facts) {
  json meta = json::parse(run.completion.meta_json, nullptr, false);
  meta.update(facts);
  run.completion.meta_json = meta.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace voxeld
