#include "server/worker/images/image_grid.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/sha256.h"
#include "server/grid/content_hash.h"
#include "server/grid/level.h"
#include "server/grid/morphology/cut_tiles.h"
#include "server/grid/region.h"
#include "server/render/camera.h"
#include "server/render/drawing_cost.h"
#include "server/worker/grids/grid_meta.h"
#include "server/worker/images/image_view.h"

namespace voxeld {
namespace {

using nlohmann::json;

// A brick on a surface has about this many voxels, and a tile about that many bricks. They only
// choose the first level to try; whether it fits is counted.
constexpr double kVoxelsPerBrick = 40.0;
constexpr double kBricksPerTileMax = 4096.0;

CellBox cells_of(const TileCoord& coord, const GridSpec& spec) {
  const glm::ivec3 low = glm::ivec3(coord[0], coord[1], coord[2]) * limits::kTileSide;
  return {low, glm::min(low + limits::kTileSide, spec.dims)};
}

bool overlap(const CellBox& a, const CellBox& b) {
  return glm::all(glm::lessThan(a.min, b.max)) && glm::all(glm::lessThan(b.min, a.max));
}

Result<ImageLimits> limits_of(Engine& engine, RendererChoice asked) {
  VOXELD_ASSIGN(const Engine::ChosenRenderer by, engine.choose_renderer(asked));
  ImageLimits limits = engine.image_limits;
  limits.table_bytes_max = std::min(limits.table_bytes_max, by.renderer->table_bytes_max());
  return limits;
}

// Loads all tiles of the source while they fit; nullopt otherwise.
Result<std::optional<Grid>> load_within(const TileSource& source, const ImageLimits& limits) {
  Grid grid = source.grid();
  DrawingCost cost;
  const size_t count = source.coords().size(), step = source.batch();
  for (size_t at = 0; at < count; at += step) {
    VOXELD_ASSIGN(std::vector<SparseTile> tiles,
                  read_tiles(source, at, std::min(count, at + step)));
    for (SparseTile& tile : tiles) {
      if (tile.empty()) continue;
      cost.add(tile);
      grid.tiles.push_back(std::move(tile));
    }
    if (!cost.fits(limits)) return std::optional<Grid>();
  }
  return std::optional(std::move(grid));
}

bool fits(const Grid& grid, const ImageLimits& limits) {
  DrawingCost cost;
  for (const SparseTile& tile : grid.tiles) cost.add(tile);
  return cost.fits(limits);
}

// Whether a level of the source is likely to fit; see kVoxelsPerBrick.
bool likely_fits(const TileSource& source, int level, const ImageLimits& limits) {
  double bricks = 0;
  for (size_t i = 0; i < source.coords().size(); ++i) {
    const auto voxels = static_cast<double>(source.voxels(i));
    bricks += std::min(voxels / kVoxelsPerBrick, kBricksPerTileMax);
  }
  bricks /= static_cast<double>(int64_t{1} << (2 * level));
  const Grid& grid = source.grid();
  const double values =
      (grid.channels.color || coloring_ids(grid) ? 4 : 0) + (grid.channels.normal ? 4 : 0);
  const double table = bricks * kDrawnBrickBytes;
  const double tile = bricks * sizeof(BrickMask);
  return table <= static_cast<double>(limits.table_bytes_max) &&
         table + tile + 2 * bricks * kVoxelsPerBrick * values <=
             static_cast<double>(limits.bytes_max);
}

std::string known_hash(const Grid& grid) {
  std::string hash = grid.meta.content_hash();
  return hash.empty() ? content_hash(grid) : hash;
}

// Finds the grid for one image.
class Finder {
 public:
  Finder(TaskRun& run, const TileSource& source, const std::string& source_key,
         const RequestOptions& options, const ImageLimits& limits)
      : run_(run), source_(source), source_key_(source_key), options_(options), limits_(limits) {
    if (options_.output.alpha == AlphaRule::kAuto) options_.output.alpha = AlphaRule::kCut;
  }

  Result<ImageGrid> find(const std::shared_ptr<const LoadedGrid>& whole) {
    OutputOptions whole_output = options_.output;
    whole_output.alpha = AlphaRule::kKeep;
    if (!selects(whole_output)) {
      VOXELD_ASSIGN(const auto all, whole_grid(whole));
      if (all != nullptr) return all_of(all);
    }
    return find_part();
  }

 private:
  // Returns null if the whole grid does not fit.
  Result<std::shared_ptr<const LoadedGrid>> whole_grid(
      const std::shared_ptr<const LoadedGrid>& whole) {
    std::shared_ptr<const LoadedGrid> none;
    if (whole != nullptr) return fits(whole->grid, limits_) ? whole : none;
    if (!likely_fits(source_, 0, limits_)) return none;
    const StageTimer stage(run_, "parse");
    InputCache& cache = run_.engine.cache;
    cache.grid.reset();
    cache.image.reset();
    VOXELD_ASSIGN(std::optional<Grid> grid, load_within(source_, limits_));
    if (!grid) return none;
    std::string hash = known_hash(*grid);
    cache.grid = std::make_shared<const LoadedGrid>(LoadedGrid{*std::move(grid), std::move(hash)});
    cache.grid_key = source_key_;
    return cache.grid;
  }

  ImageGrid all_of(const std::shared_ptr<const LoadedGrid>& grid) {
    add_meta(run_, grid_facts(*grid));
    tell(0, grid->grid.tiles.size(), grid->grid.voxel_count());
    if (!cuts_transparent(options_.output) ||
        std::ranges::none_of(grid->grid.tiles, has_transparent_voxels)) {
      return {grid, source_key_, options_.render};
    }
    InputCache& cache = run_.engine.cache;
    const std::string key = source_key_ + " cut";
    if (cache.image == nullptr || cache.image_key != key) {
      cache.image = std::make_shared<const LoadedGrid>(
          LoadedGrid{without_transparent_voxels(grid->grid), std::string(), 0});
      cache.image_key = key;
    }
    return {cache.image, key, options_.render};
  }

  // All tiles of the region if they fit at the level that is asked for. Else those in view, at the
  // finest useful level that fits.
  Result<ImageGrid> find_part() {
    const StageTimer stage(run_, "parse");
    const GridSpec& spec = source_.grid().spec;
    VOXELD_ASSIGN(const CellBox region, region_at_level(spec, options_.output, 0));
    const SomeTiles touched(
        source_, [&](const TileCoord& coord) { return overlap(cells_of(coord, spec), region); });
    ImageGrid image{nullptr, "", options_.render};
    const std::string all_key = part_key(touched, options_.output.level);
    InputCache& cache = run_.engine.cache;
    if (likely_fits(touched, options_.output.level, limits_) && cache.too_large_key != all_key) {
      VOXELD_ASSIGN(image.grid, load_at(touched, options_.output.level, all_key));
      image.key = all_key;
      if (image.grid != nullptr) return image;
      cache.too_large_key = all_key;
    }
    VOXELD_TRY(frame(touched, region, image.options));
    const ImageView view(image.options, spec);
    double pixels = 0;
    const SomeTiles seen(touched, [&](const TileCoord& coord) {
      const CellBox cells = cells_of(coord, spec);
      if (!view.sees(cells)) return false;
      pixels = std::max(pixels, view.cell_pixels(cells));
      return true;
    });
    int level = options_.output.level;
    if (!likely_fits(seen, level, limits_)) level = std::max(level, level_of_pixels(pixels));
    while (level < kLevelMax && !likely_fits(seen, level, limits_)) ++level;
    VOXELD_ASSIGN(image.grid, load_part(seen, level, image.key));
    return image;
  }

  // Sets the camera and the floor for the whole grid, or for its region, whichever part is drawn.
  Status frame(const TileSource& touched, const CellBox& region, RenderOptions& render) {
    VOXELD_ASSIGN(CellBox box, occupied_box(touched));
    box = {glm::max(box.min, region.min), glm::min(box.max, region.max)};
    if (glm::any(glm::greaterThanEqual(box.min, box.max))) box = region;
    const GridSpec& spec = source_.grid().spec;
    const auto world = [&](const glm::ivec3& p) { return spec.world_from_grid(glm::dvec3(p)); };
    if (!render.ground_y_world) render.ground_y_world = world(box.min).y;
    if (render.matrix) return {};
    Subject subject{world(box.min), world(box.max), {}};
    for (const TileCoord& coord : touched.coords()) {
      cancel_point();
      CellBox cells = cells_of(coord, spec);
      cells = {glm::max(cells.min, box.min), glm::min(cells.max, box.max)};
      const Subject tile = box_subject(world(cells.min), world(cells.max));
      subject.points_world.insert(subject.points_world.end(), tile.points_world.begin(),
                                  tile.points_world.end());
    }
    render.matrix = row_major(make_camera(render, subject).clip_from_world);
    return {};
  }

  // Loads the first level from this one on that fits.
  Result<std::shared_ptr<const LoadedGrid>> load_part(const TileSource& seen, int level,
                                                      std::string& key) {
    key = part_key(seen, level);
    for (; level <= kLevelMax; ++level) {
      VOXELD_ASSIGN(auto part, load_at(seen, level, key));
      if (part != nullptr) return part;
    }
    return Error{ErrorCode::kGridTooLarge, "the grid cannot be drawn in the memory there is",
                 std::to_string(limits_.bytes_max) + " bytes", "more at every level"};
  }

  // The grid that is resident under the key, or the tiles at a level. Null if they do not fit.
  Result<std::shared_ptr<const LoadedGrid>> load_at(const TileSource& seen, int level,
                                                    const std::string& key) {
    InputCache& cache = run_.engine.cache;
    if (cache.image == nullptr || cache.image_key != key) {
      cache.image.reset();
      OutputOptions output = options_.output;
      output.level = level;
      VOXELD_ASSIGN(const Selection selection, Selection::open(seen, output));
      VOXELD_ASSIGN(std::optional<Grid> grid, load_within(selection.tiles(), limits_));
      if (!grid) return std::shared_ptr<const LoadedGrid>();
      cache.image =
          std::make_shared<const LoadedGrid>(LoadedGrid{*std::move(grid), std::string(), level});
      cache.image_key = key;
    }
    tell_part(*cache.image, seen);
    return cache.image;
  }

  // The cache key of these tiles at a level. `level` is the one tried first. What fits depends on
  // the renderer, too.
  std::string part_key(const TileSource& seen, int level) const {
    Sha256 hash;
    for (const TileCoord& coord : seen.coords()) {
      hash.update(std::to_string(coord_order(coord)) + " ");
    }
    json name = {{"grid", source_key_}, {"tiles", hash.finish_id()}, {"level", level}};
    name["table_bytes_max"] = limits_.table_bytes_max;
    name["rule"] = static_cast<int>(options_.output.level_rule);
    name["alpha"] = static_cast<int>(options_.output.alpha);
    if (options_.output.region) name["region"] = *options_.output.region;
    return name.dump();
  }

  void tell_part(const LoadedGrid& part, const TileSource& seen) {
    tell(part.level, seen.coords().size(), part.grid.voxel_count());
  }

  void tell(int level, size_t tiles, uint64_t voxels) {
    json drawn = {{"level", level},
                  {"tiles", tiles},
                  {"tiles_in_grid", source_.coords().size()},
                  {"voxels", voxels}};
    add_meta(run_, {{"drawn", drawn}});
  }

  TaskRun& run_;
  const TileSource& source_;
  const std::string& source_key_;
  RequestOptions options_;
  const ImageLimits limits_;
};

}  // namespace

Result<ImageGrid> image_grid(TaskRun& run, const TileSource& source, const std::string& source_key,
                             const std::shared_ptr<const LoadedGrid>& whole,
                             const RequestOptions& options) {
  VOXELD_ASSIGN(const ImageLimits limits, limits_of(run.engine, options.render.renderer));
  return Finder(run, source, source_key, options, limits).find(whole);
}

}  // namespace voxeld
