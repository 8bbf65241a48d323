#include "server/worker/grids/grid_meta.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/options/table.h"
#include "proto/options/words.h"
#include "server/base/algorithm_version.h"
#include "server/voxel/attributes/part_ids.h"
#include "server/worker/mesh/inspect.h"

namespace voxeld {
namespace {

using nlohmann::json;

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
json response_meta(json meta) {
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

}  // namespace

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

GridMeta container_meta(const Task& task, const Scene& scene, const json& options,
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
  return GridMeta(std::move(meta));
}

void add_making_meta(TaskRun& run, const GridMeta& container_meta, const VoxelizeStats& stats) {
  add_meta(run, response_meta(container_meta.members()));
  add_meta(run, device_facts(run.engine));
  add_meta(run, {{"triangles", stats.triangles},
                 {"tiles", stats.tiles},
                 {"pipeline", pipeline_name(stats.pipeline)},
                 {"pipeline_reason", stats.pipeline_reason},
                 {"device_bytes_peak", stats.device_bytes_peak}});
  if (!stats.device_failure.empty()) add_meta(run, {{"device_failure", stats.device_failure}});
  json passes = json::object();
  for (const auto& [name, ms] : stats.passes) passes[name] = ms;
  add_meta(run, {{"passes_ms", passes}});
}

std::vector<Warning> grid_warnings(const VoxelizeOptions& options, uint64_t voxel_count,
                                   const VoxelizeStats& stats) {
  std::vector<Warning> warnings;
  const std::optional<FillStats>& fill = stats.fill;
  const bool fills = options.fill == Fill::kSolid || options.fill == Fill::kShell;
  if (fills && fill && fill->sign_with_inside) {
    warnings.push_back(
        {"empty-solid",
         "no cell is inside by sign=" + std::string(option_words::sign_name(fill->sign)) +
             ", but some are by sign=" +
             std::string(option_words::sign_name(*fill->sign_with_inside)) +
             ": try that, or fill=surface"});
  } else if (voxel_count == 0) {
    warnings.push_back(
        {"no-voxels",
         "the grid has no voxels: the mesh is beside its box, or its parts lie between "
         "the cells' centres; try other bounds, rule=touch or a finer size"});
  }
  constexpr double kAmbiguousMax = 0.01;
  if (fills && fill && fill->ambiguous_fraction.value_or(0) > kAmbiguousMax) {
    const auto percent = std::lround(100 * *fill->ambiguous_fraction);
    warnings.push_back({"ambiguous-solid",
                        "the axes disagree about " + std::to_string(percent) +
                            "% of the cells inside, as the mesh has holes wider than a cell; try "
                            "sign=majority or winding, a coarser size, or fill=surface"});
  }
  return warnings;
}

void note_device(Engine& engine, const VoxelizeStats& stats, const Status& made) {
  const bool has_worked = made.ok() && stats.pipeline != Pipeline::kCpu;
  if (!stats.device_failure.empty() || has_worked) engine.note_device(stats.device_failure);
}

void add_input_meta(TaskRun& run, const GridMeta& container_meta) {
  add_meta(run, response_meta(container_meta.members()));
  add_meta(run, device_facts(run.engine));
}

json place_facts(const GridSpec& spec) {
  return {{"dims", {spec.dims.x, spec.dims.y, spec.dims.z}},
          {"origin", {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z}},
          {"voxel_size", {spec.voxel_size.x, spec.voxel_size.y, spec.voxel_size.z}}};
}

json channel_facts(const ChannelSet& channels) {
  json names = json::array({"occupancy"});
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) names.push_back(info.name);
  }
  return names;
}

json grid_facts(const Grid& grid, uint64_t voxel_count, const std::string& content_hash) {
  json facts = place_facts(grid.spec);
  facts.update({{"voxel_count", voxel_count},
                {"channels", channel_facts(grid.channels)},
                {"content_hash", content_hash}});
  return facts;
}

json grid_facts(const LoadedGrid& loaded) {
  return grid_facts(loaded.grid, loaded.grid.voxel_count(), loaded.content_hash);
}

}  // namespace voxeld
