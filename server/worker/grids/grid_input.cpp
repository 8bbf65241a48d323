#include "server/worker/grids/grid_input.h"

#include <algorithm>
#include <map>
#include <utility>

#include "proto/options/values.h"
#include "proto/options/words.h"
#include "server/base/disk/mapped_pages.h"
#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/zarr/zarr.h"
#include "server/grid/content_hash.h"
#include "server/grid/level.h"
#include "server/grid/morphology/cut_tiles.h"
#include "server/grid/region.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/grids/host_estimate.h"

namespace voxeld {
namespace {

using nlohmann::json;

// After this many tiles the pages of the file are released.
constexpr int64_t kTilesResident = 64;

// "xz": the axes along which cells are in reverse order.
std::string mirrored_axes(const OutputOptions& output) {
  std::string axes;
  for (size_t c = 0; c < output.mirror.size(); ++c) {
    if (output.mirror[c]) axes += "xyz"[c];
  }
  return axes;
}

// The names of labels after their numbers have changed, as {id, name} ascending by id. Labels that
// become one have the name of the unchanged one, or else that of the lowest.
json remapped_names(const json& labels, const std::vector<LabelChange>& changes) {
  std::map<int64_t, json> named;
  for (const json& label : labels) {
    if (!label.is_object() || !label.contains("id") || !label["id"].is_number_integer()) continue;
    json moved = label;
    const auto id = label["id"].get<int64_t>();
    const auto at = std::ranges::find(changes, id, [](const LabelChange& c) { return c.from; });
    const bool is_changed = at != changes.end() && at->to != at->from;
    const int64_t number = is_changed ? at->to : id;
    moved["id"] = number;
    if (is_changed && named.contains(number)) continue;
    named[number] = std::move(moved);
  }
  json list = json::array();
  for (auto& [number, label] : named) list.push_back(std::move(label));
  return list;
}

void add_morphology_facts(const Grid& whole, const OutputOptions& output, json& facts) {
  if (output.alpha == AlphaRule::kCut) facts["alpha"] = "cut";
  if (output.keep > 0) facts["keep"] = output.keep;
  if (output.dilate > 0) facts["dilate"] = output.dilate;
  if (output.erode > 0) facts["erode"] = output.erode;
  if (output.hollow > 0) facts["hollow"] = output.hollow;
  if (changes_voxels(output)) {
    facts["neighbors"] =
        option_values::word_of<Neighbors>(output.neighbors, option_words::kNeighbors);
  }
  const json& meta = whole.meta.members();
  if (output.remap.empty() || !meta.contains("labels") || !meta["labels"].is_array()) return;
  facts["labels"] = remapped_names(meta["labels"], output.remap);
}

// The meta of a selection's container.
GridMeta selection_meta(const TileSource& source, const TileSource& tiles,
                        const OutputOptions& output, const json& grid_facts) {
  if (!selects(output)) return source.grid().meta;
  json facts = selection_facts(source.grid(), output);
  facts.update(grid_facts);
  return tiles.grid().meta.with(facts);
}

Status write_native(TaskRun& run, const TileSource& source, const TileSource& tiles,
                    const OutputOptions& output) {
  const std::filesystem::path path = next_output(run);
  GridFile file(path, output.codec);
  GridOutput sink({&file}, false, 0);
  VOXELD_TRY(sink.begin(tiles.grid()));
  VOXELD_TRY(for_each_batch(
      tiles, [&](std::vector<SparseTile> batch) { return sink.add(std::move(batch)); }));
  const json facts = grid_facts(tiles.grid(), sink.voxel_count(), sink.finish_hash());
  const GridMeta meta = selection_meta(source, tiles, output, facts);
  VOXELD_TRY(file.finish(meta));
  add_meta(run, meta.members());
  add_meta(run, facts);
  const bool is_grid = selects(output) && output.codec == OutputOptions{}.codec;
  list_output(run, path, is_grid ? "grid result" : "result", format_media_type(Format::kNative),
              format_extension(Format::kNative));
  return run.monitor.check();
}

// The levels of a Zarr store need the tiles several times, and never all at once.
Status write_zarr(TaskRun& run, const TileSource& source, const TileSource& tiles,
                  const OutputOptions& output) {
  const std::filesystem::path path = next_output(run);
  json facts = place_facts(tiles.grid().spec);
  if (selects(output)) {
    ContentHasher hasher(tiles.grid());
    uint64_t voxel_count = 0;
    VOXELD_TRY(for_each_batch(tiles, [&](const std::vector<SparseTile>& batch) -> Status {
      for (const SparseTile& tile : batch) {
        hasher.add(tile);
        voxel_count += tile.voxel_count();
      }
      return {};
    }));
    facts = grid_facts(tiles.grid(), voxel_count, hasher.finish());
  }
  const GridMeta meta = selection_meta(source, tiles, output, facts);
  {
    VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
    VOXELD_TRY(zarr::write_store(tiles, meta, output, file));
  }
  add_meta(run, meta.members());
  add_warnings(run, encode_warnings(tiles.grid(), output));
  list_output(run, path, "result", format_media_type(Format::kZarr),
              format_extension(Format::kZarr));
  return run.monitor.check();
}

Status write_other(TaskRun& run, const TileSource& source, const TileSource& tiles,
                   const OutputOptions& output) {
  Grid grid = tiles.grid();
  VOXELD_TRY(for_each_batch(tiles, [&](std::vector<SparseTile> batch) -> Status {
    for (SparseTile& tile : batch) grid.tiles.push_back(std::move(tile));
    return {};
  }));
  const json facts = grid_facts(grid, grid.voxel_count(), content_hash(grid));
  grid.meta = selection_meta(source, tiles, output, facts);
  add_meta(run, grid.meta.members());
  add_meta(run, facts);
  return write_result(run, grid, output);
}

}  // namespace

Status write_result(TaskRun& run, const Grid& grid, const OutputOptions& output) {
  if (cuts_transparent(output) && std::ranges::any_of(grid.tiles, has_transparent_voxels)) {
    OutputOptions keeping = output;
    keeping.alpha = AlphaRule::kKeep;
    return write_result(run, without_transparent_voxels(grid), keeping);
  }
  const std::filesystem::path path = next_output(run);
  VOXELD_TRY(write_grid(grid, output, path));
  add_warnings(run, encode_warnings(grid, output));
  list_output(run, path, "result", format_media_type(output.format),
              format_extension(output.format));
  return run.monitor.check();
}

json selection_facts(const Grid& whole, const OutputOptions& output) {
  json facts = {{"level", output.level}};
  if (output.level > 0) {
    facts["level_rule"] =
        option_values::word_of<LevelRule>(output.level_rule, option_words::kLevelRule);
  }
  if (output.region) facts["region"] = *output.region;
  add_morphology_facts(whole, output, facts);
  const std::string axes = mirrored_axes(output);
  if (!axes.empty()) facts["mirror"] = axes;
  if (recolors(output)) facts["palette_colors"] = output.palette.size();
  const glm::ivec3 dims = whole.spec.dims;
  facts["of"] = {{"dims", {dims.x, dims.y, dims.z}}};
  const std::string hash = whole.meta.content_hash();
  if (!hash.empty()) facts["of"]["content_hash"] = hash;
  return facts;
}

Result<std::unique_ptr<GridInput>> GridInput::open(TaskRun& run,
                                                   const std::filesystem::path& path) {
  VOXELD_ASSIGN(MappedFile file, MappedFile::open(path));
  std::unique_ptr<GridInput> input(new GridInput(run, std::move(file)));
  VOXELD_ASSIGN(GridReader reader, GridReader::open(input->file_.bytes()));
  input->tiles_.emplace(std::move(reader), [self = input.get()] { return self->before_tile(); });
  return input;
}

Status GridInput::before_tile() {
  const int64_t read = ++read_;
  const auto total = static_cast<int64_t>(tiles_->coords().size());
  if (read % kTilesResident == 0) drop_mapped_pages(file_.bytes());
  // Clamped, because a tile may be read more than once.
  (void)run_.monitor.set_progress(std::min(read, total), total);
  return run_.monitor.check();
}

Result<GridSpec> selected_spec(const GridSpec& spec, const OutputOptions& output) {
  VOXELD_ASSIGN(const CellBox box, region_at_level(spec, output, output.level));
  GridSpec selected = level_spec(spec, output.level);
  selected.origin_world = selected.world_from_grid(glm::dvec3(box.min));
  selected.dims = box.max - box.min;
  return selected;
}

Status write_selection(TaskRun& run, const TileSource& source, const OutputOptions& asked) {
  const StageTimer stage(run, "encode");
  VOXELD_TRY(check_channels(source.grid().channels, asked));
  OutputOptions output = asked;
  CellBox crop;
  if (asked.crop) {
    VOXELD_ASSIGN(crop, occupied_selection(source, asked));
    output = crop_to(asked, source.grid().spec, crop);
  }
  VOXELD_ASSIGN(const Selection selection, Selection::open(source, asked, crop));
  const TileSource& tiles = selection.tiles();
  VOXELD_TRY(check_encodable(tiles.grid().spec, output));
  expect_bytes(run, selection_bytes(source, tiles, output));
  if (output.format == Format::kNative) return write_native(run, source, tiles, output);
  if (output.format == Format::kZarr) return write_zarr(run, source, tiles, output);
  return write_other(run, source, tiles, output);
}

bool is_made_from_tiles(const OutputOptions& output) {
  return selects(output) || output.format == Format::kZarr;
}

}  // namespace voxeld
