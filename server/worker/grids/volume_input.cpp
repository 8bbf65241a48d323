#include "server/worker/grids/volume_input.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "proto/container/distance_unit.h"
#include "server/base/algorithm_version.h"
#include "server/base/disk/file.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "server/volumes/volume.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/grids/grid_input.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"
#include "server/worker/mesh/inspect.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Tiles that are encoded together.
constexpr size_t kTilesPerBatch = 64;

struct VolumeInput {
  Volume volume;
  VolumeFormat format;
};

Result<VolumeInput> load_volume_input(TaskRun& run, double threshold) {
  const StageTimer stage(run, "parse");
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(run.task.input_path));
  const std::string name = run.task.filename.empty() ? "the upload" : run.task.filename;
  VOXELD_ASSIGN(Volume volume, load_volume(name, file.bytes(), threshold));
  VOXELD_TRY(run.monitor.check());
  return VolumeInput{std::move(volume), *detect_volume(file.bytes())};
}

Status check_has_no_mesh_options(const RequestOptions& options) {
  if (options.animation.moves()) {
    return Error{ErrorCode::kInvalidOption, "animation: a file of voxels has no animations",
                 "a mesh", "voxels"};
  }
  if (options.voxelize.variant) {
    return Error{ErrorCode::kInvalidOption, "variant: a file of voxels has no variants", "a mesh",
                 "voxels"};
  }
  return {};
}

// The options that decide how a mesh becomes a grid and differ from their defaults.
std::vector<Warning> unused_options(const RequestOptions& options) {
  const json given = grid_options(options), usual = grid_options(RequestOptions{});
  std::string names;
  for (const auto& [name, value] : given.items()) {
    if (name == "threshold" || (usual.contains(name) && usual[name] == value)) continue;
    names += (names.empty() ? "" : ", ") + name;
  }
  if (names.empty()) return {};
  return {{"unused-options", "the file's voxels are taken as they are, without " + names}};
}

// The units of an uploaded container, if they are a word that files of other formats can hold.
std::string units_of_container(const json& known) {
  constexpr size_t kUnitsBytesMax = 64;
  const auto units = known.find("units");
  if (units == known.end() || !units->is_string()) return "";
  const auto& text = units->get_ref<const std::string&>();
  const bool is_word = text.size() <= kUnitsBytesMax && std::ranges::none_of(text, [](char c) {
                         return static_cast<unsigned char>(c) < ' ' || c == '"';
                       });
  return is_word ? text : "";
}

// The meta of the grid's container. A container that was uploaded keeps its names and units, that
// of its distances included, and its fill, which tells on which side cells without voxels are.
GridMeta volume_meta(const Task& task, const VolumeInput& input, double threshold,
                     const json& facts) {
  const json& known = input.volume.grid.meta.members();
  json meta = {
      {"source_hash", task.input_hash},     {"source_format", volume_format_name(input.format)},
      {"units", units_of_container(known)}, {"options", json::object()},
      {"warnings", describe_warnings({})},  {"algorithm_version", kAlgorithmVersion}};
  const bool has_samples =
      input.format == VolumeFormat::kNpy || input.format == VolumeFormat::kNrrd;
  if (has_samples) meta["options"]["threshold"] = threshold;
  if (input.volume.grid.channels.distance && has_world_distances(known)) {
    meta["options"]["distance"] = known["options"]["distance"];
  }
  if (const auto options = known.find("options"); options != known.end() && options->is_object()) {
    const auto fill = options->find("fill");
    if (fill != options->end() && fill->is_string()) meta["options"]["fill"] = *fill;
  }
  if (const GridMeta& own = input.volume.grid.meta; own.is_band()) {
    meta["band_voxels"] = own.band_voxels();
  }
  for (const char* names : {"materials", "labels"}) {
    if (known.contains(names)) meta[names] = known[names];
  }
  meta.update(facts);
  return GridMeta(std::move(meta));
}

int64_t tiles_bytes(const Grid& grid) {
  size_t bytes = 0;
  for (const SparseTile& tile : grid.tiles) bytes += tile_bytes(tile);
  return static_cast<int64_t>(bytes);
}

}  // namespace

Result<bool> is_volume_input(const Task& task) {
  if (!task.bundle_paths.empty() || task.input_is_grid || task.input_is_sequence) return false;
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(task.input_path));
  return detect_volume(file.bytes()).has_value();
}

Result<WrittenGrid> volume_to_file(TaskRun& run, const RequestOptions& options) {
  VOXELD_TRY(check_has_no_mesh_options(options));
  const OutputOptions& asked = options.output;
  const double threshold = options.voxelize.threshold;
  VOXELD_ASSIGN(VolumeInput input, load_volume_input(run, threshold));
  add_warnings(run, input.volume.warnings);
  add_warnings(run, unused_options(options));
  Grid& grid = input.volume.grid;
  VOXELD_TRY(check_cells(run.task, grid.spec));
  VOXELD_ASSIGN(const GridSpec selected, selected_spec(grid.spec, asked));
  VOXELD_TRY(check_encodable(selected, asked));
  VOXELD_TRY(check_channels(grid.channels, asked));
  expect_bytes(run, tiles_bytes(grid));

  const StageTimer stage(run, "encode");
  const std::string hash = content_hash(grid);
  const json facts = grid_facts(grid, grid.voxel_count(), hash);
  const GridMeta meta = volume_meta(run.task, input, threshold, facts);
  add_input_meta(run, meta);
  NewContainers containers(run, asked);
  for (GridFile* file : containers.files()) {
    VOXELD_TRY(file->begin(grid));
    const std::span<const SparseTile> tiles = grid.tiles;
    for (size_t at = 0; at < tiles.size(); at += kTilesPerBatch) {
      VOXELD_TRY(file->add(tiles.subspan(at, std::min(kTilesPerBatch, tiles.size() - at))));
      VOXELD_TRY(run.monitor.check());
    }
  }
  VOXELD_ASSIGN(WrittenGrid written, containers.finish(meta));
  grid.meta = meta;
  written.kept = LoadedGrid{std::move(grid), hash};
  return written;
}

Result<json> describe_volume_input(TaskRun& run) {
  VOXELD_ASSIGN(const VolumeInput input, load_volume_input(run, VoxelizeOptions{}.threshold));
  add_warnings(run, input.volume.warnings);
  AnimatedScene none;
  none.scene.format = volume_format_name(input.format);
  json description = describe_scene(none);
  const Grid& grid = input.volume.grid;
  description["vertices"] = nullptr;
  description["has_colors"] = grid.channels.color;
  const glm::dvec3 min = grid.spec.origin_world;
  const glm::dvec3 max = grid.spec.world_from_grid(glm::dvec3(grid.spec.dims));
  description["bounds"] = {{"min", {min.x, min.y, min.z}}, {"max", {max.x, max.y, max.z}}};
  description["voxels"] = place_facts(grid.spec);
  description["voxels"]["voxel_count"] = grid.voxel_count();
  description["voxels"]["channels"] = channel_facts(grid.channels);
  return description;
}

}  // namespace voxeld
