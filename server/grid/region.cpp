#include "server/grid/region.h"

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/grid/color/palette_tiles.h"
#include "server/grid/level.h"
#include "server/grid/morphology/component_tiles.h"
#include "server/grid/morphology/cut_tiles.h"
#include "server/grid/morphology/remap_tiles.h"
#include "server/grid/morphology/step_tiles.h"
#include "server/grid/tile_appender.h"

namespace voxeld {
namespace {

constexpr size_t kTileBricks = size_t{1} << (3 * kTileLevels);

glm::ivec3 first_cell(const TileCoord& coord) {
  return glm::ivec3(coord[0], coord[1], coord[2]) * limits::kTileSide;
}

// A tile of the region while it is assembled: first the occupied cells, then their values.
class Canvas {
 public:
  // `cells`: those of the source that the tile covers.
  Canvas(const CellBox& cells, const MirrorAxes& mirror)
      : cells_(cells), mirror_(mirror), masks_(kTileBricks) {}

  void mark(const SparseTile& tile) {
    for_each_inside(tile, [&](uint32_t code, size_t) {
      masks_[code >> 9].words[code >> 6 & 7] |= uint64_t{1} << (code & 63);
    });
  }

  // Call it after all tiles are marked.
  void number_voxels() {
    firsts_.resize(kTileBricks);
    size_t count = 0;
    for (size_t brick = 0; brick < kTileBricks; ++brick) {
      firsts_[brick] = static_cast<uint32_t>(count);
      for (const uint64_t word : masks_[brick].words) {
        count += static_cast<size_t>(std::popcount(word));
      }
    }
    values_.resize(count);
  }

  void copy_values(const SparseTile& tile) {
    for_each_inside(tile, [&](uint32_t code, size_t index) {
      if (index == kNoAttributes) return;
      VoxelValues values = values_of(tile, index);
      for (size_t c = 0; c < mirror_.size(); ++c) {
        // -128, which no unit normal is, has no opposite.
        if (mirror_[c]) values.normal[c] = static_cast<int8_t>(-std::max(-127, +values.normal[c]));
      }
      values_[number_of(code)] = values;
    });
  }

  SparseTile finish(const TileCoord& coord, const ChannelSet& channels) const {
    TileAppender out(coord, channels);
    size_t voxel = 0;
    for (size_t brick = 0; brick < kTileBricks; ++brick) {
      cancel_point();
      for (uint32_t word = 0; word < 8; ++word) {
        for (uint64_t bits = masks_[brick].words[word]; bits != 0; bits &= bits - 1) {
          const auto bit = static_cast<uint32_t>(std::countr_zero(bits));
          out.add(static_cast<uint32_t>(brick) << 9 | word << 6 | bit,
                  values_.empty() ? VoxelValues{} : values_[voxel]);
          ++voxel;
        }
      }
    }
    return out.finish();
  }

 private:
  template <typename Visit>
  void for_each_inside(const SparseTile& tile, Visit&& visit) const {
    for_each_voxel(tile, [&](int x, int y, int z, size_t index) {
      cancel_point();
      const glm::ivec3 cell(x, y, z);
      if (glm::any(glm::lessThan(cell, cells_.min)) ||
          glm::any(glm::greaterThanEqual(cell, cells_.max))) {
        return;
      }
      const auto at = [&](int c) {
        const bool is_mirrored = mirror_[static_cast<size_t>(c)];
        return static_cast<uint32_t>(is_mirrored ? cells_.max[c] - 1 - cell[c]
                                                 : cell[c] - cells_.min[c]);
      };
      visit(morton_encode(at(0), at(1), at(2)), index);
    });
  }

  size_t number_of(uint32_t code) const {
    const BrickMask& mask = masks_[code >> 9];
    size_t number = firsts_[code >> 9];
    const uint32_t word = code >> 6 & 7;
    for (uint32_t i = 0; i < word; ++i) {
      number += static_cast<size_t>(std::popcount(mask.words[i]));
    }
    const uint64_t below = (uint64_t{1} << (code & 63)) - 1;
    return number + static_cast<size_t>(std::popcount(mask.words[word] & below));
  }

  CellBox cells_;
  MirrorAxes mirror_;
  std::vector<BrickMask> masks_;
  std::vector<uint32_t> firsts_;  // voxels before each brick
  std::vector<VoxelValues> values_;
};

std::string corners(const std::array<int, 6>& region) {
  std::string text;
  for (const int value : region) {
    if (!text.empty()) text += ',';
    text += std::to_string(value);
  }
  return text;
}

}  // namespace

RegionTiles::RegionTiles(const TileSource& source, const CellBox& box, const MirrorAxes& mirror)
    : cached_(source), box_(box), mirror_(mirror) {
  const Grid& grid = source.grid();
  VOXELD_CHECK(glm::all(glm::greaterThanEqual(box.min, glm::ivec3(0))) &&
                   glm::all(glm::lessThan(box.min, box.max)) &&
                   glm::all(glm::lessThanEqual(box.max, grid.spec.dims)),
               "regions lie in their grid");
  grid_.spec = grid.spec;
  grid_.spec.dims = box.max - box.min;
  grid_.spec.origin_world = grid.spec.world_from_grid(glm::dvec3(box.min));
  grid_.channels = grid.channels;
  grid_.meta = grid.meta;
  for (const TileCoord& coord : source.coords()) {
    const glm::ivec3 low = glm::max(first_cell(coord), box.min) - box.min;
    const glm::ivec3 high = glm::min(first_cell(coord) + limits::kTileSide, box.max) - box.min;
    if (glm::any(glm::greaterThanEqual(low, high))) continue;
    const CellBox cells = reflected({low, high});
    const glm::ivec3 first = cells.min / limits::kTileSide;
    const glm::ivec3 last = (cells.max - 1) / limits::kTileSide;
    for (int z = first.z; z <= last.z; ++z) {
      for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) coords_.push_back({x, y, z});
      }
    }
  }
  std::ranges::sort(coords_, {}, [](const TileCoord& coord) { return coord_order(coord); });
  coords_.erase(std::unique(coords_.begin(), coords_.end()), coords_.end());
}

CellBox RegionTiles::reflected(const CellBox& cells) const {
  const glm::ivec3 size = box_.max - box_.min;
  CellBox out = cells;
  for (int c = 0; c < 3; ++c) {
    if (!mirror_[static_cast<size_t>(c)]) continue;
    out.min[c] = size[c] - cells.max[c];
    out.max[c] = size[c] - cells.min[c];
  }
  return out;
}

Result<SparseTile> RegionTiles::tile(size_t index) const {
  const TileCoord& coord = coords_[index];
  const glm::ivec3 first = first_cell(coord);
  const glm::ivec3 end = glm::min(first + limits::kTileSide, box_.max - box_.min);
  CellBox cells = reflected({first, end});
  cells = {cells.min + box_.min, cells.max + box_.min};
  VOXELD_ASSIGN(const std::vector<SparseTile> sources, cached_.tiles_in(cells));
  Canvas canvas(cells, mirror_);
  for (const SparseTile& source : sources) canvas.mark(source);
  if (grid_.channels.any()) {
    canvas.number_voxels();
    for (const SparseTile& source : sources) canvas.copy_values(source);
  }
  return canvas.finish(coord, grid_.channels);
}

Result<CellBox> occupied_selection(const TileSource& source, const OutputOptions& options) {
  OutputOptions whole = options;
  whole.mirror = {};
  whole.palette.clear();
  whole.remap.clear();
  VOXELD_ASSIGN(const Selection selection, Selection::open(source, whole));
  VOXELD_ASSIGN(CellBox box, occupied_box(selection.tiles()));
  if (box.empty()) return box;
  return CellBox{box.min + selection.box().min, box.max + selection.box().min};
}

OutputOptions crop_to(const OutputOptions& options, const GridSpec& spec, const CellBox& box) {
  OutputOptions cropped = options;
  cropped.crop = false;
  if (box.empty()) return cropped;
  std::array<int, 6>& region = cropped.region.emplace();
  for (int c = 0; c < 3; ++c) {
    const auto at = static_cast<size_t>(c);
    region[at] = box.min[c] << options.level;
    region[at + 3] = std::min(box.max[c] << options.level, spec.dims[c]);
  }
  return cropped;
}

Result<CellBox> region_at_level(const GridSpec& spec, const OutputOptions& options, int level) {
  if (!options.region) return CellBox{glm::ivec3(0), level_spec(spec, level).dims};
  const std::array<int, 6>& r = *options.region;
  const glm::ivec3 low(r[0], r[1], r[2]), high(r[3], r[4], r[5]);
  if (glm::any(glm::lessThan(low, glm::ivec3(0))) || glm::any(glm::greaterThan(high, spec.dims)) ||
      glm::any(glm::greaterThanEqual(low, high))) {
    return Error{ErrorCode::kInvalidOption, "region",
                 "x0,y0,z0,x1,y1,z1 in the grid's cells, from 0,0,0 to " +
                     std::to_string(spec.dims.x) + "," + std::to_string(spec.dims.y) + "," +
                     std::to_string(spec.dims.z) + ", each minimum below its maximum",
                 corners(r)};
  }
  CellBox box;
  for (int c = 0; c < 3; ++c) {
    box.min[c] = low[c] >> level;
    box.max[c] = ((high[c] - 1) >> level) + 1;
  }
  return box;
}

void Selection::push(std::unique_ptr<TileSource> stage) {
  last_ = stage.get();
  stages_.push_back(std::move(stage));
}

// Only whole tiles under the box's cubes; other tiles are never read.
void Selection::push_level(const TileSource& source, const OutputOptions& options) {
  const CellBox box = box_;
  if (box.min != glm::ivec3(0) || box.max != level_spec(source.grid().spec, options.level).dims) {
    push(std::make_unique<SomeTiles>(source, [&](const TileCoord& coord) {
      const int64_t scale = int64_t{1} << options.level;
      for (int c = 0; c < 3; ++c) {
        const int64_t low = int64_t{coord[static_cast<size_t>(c)]} * limits::kTileSide;
        if (low >= box.max[c] * scale || low + limits::kTileSide <= box.min[c] * scale) {
          return false;
        }
      }
      return true;
    }));
  }
  if (options.level > 0) {
    push(std::make_unique<LevelTiles>(tiles(), options.level, options.level_rule));
  }
}

Status Selection::push_morphology(const OutputOptions& options) {
  if (options.keep > 0) {
    VOXELD_ASSIGN(auto kept, ComponentTiles::open(tiles(), options.keep, options.neighbors));
    push(std::move(kept));
  }
  const auto push_steps = [&](StepKind kind, int steps) {
    if (steps == 0) return;
    push(std::make_unique<StepTiles>(tiles(), kind, steps, options.neighbors));
  };
  push_steps(StepKind::kDilate, options.dilate);
  push_steps(StepKind::kErode, options.erode);
  push_steps(StepKind::kHollow, options.hollow);
  return {};
}

Result<Selection> Selection::open(const TileSource& source, const OutputOptions& options,
                                  const CellBox& crop) {
  Selection selection;
  selection.last_ = &source;
  VOXELD_ASSIGN(selection.box_, region_at_level(source.grid().spec, options, options.level));
  const bool is_cropped = !crop.empty();
  bool is_boxed = options.region.has_value();  // the last stage has more cells than the box
  if (is_cropped && !changes_voxels(options)) {
    selection.box_ = crop;
    is_boxed = true;
  }
  selection.push_level(source, options);
  if (cuts_transparent(options) && source.grid().channels.color) {
    selection.push(std::make_unique<CutTiles>(selection.tiles()));
  }
  if (changes_voxels(options)) {
    if (is_boxed) {
      selection.push(std::make_unique<RegionTiles>(selection.tiles(), selection.box_));
    }
    VOXELD_TRY(selection.push_morphology(options));
    is_boxed = is_cropped;
  }
  if (is_boxed || options.mirror != MirrorAxes{}) {
    CellBox box{glm::ivec3(0), selection.tiles().grid().spec.dims};
    if (!changes_voxels(options)) {
      box = selection.box_;
    } else if (is_cropped) {
      box = {crop.min - selection.box_.min, crop.max - selection.box_.min};
      selection.box_ = crop;
    }
    selection.push(std::make_unique<RegionTiles>(selection.tiles(), box, options.mirror));
  }
  if (!options.remap.empty()) {
    selection.push(std::make_unique<RemapTiles>(selection.tiles(), options.remap));
  }
  if (recolors(options)) {
    selection.push(
        std::make_unique<PaletteTiles>(selection.tiles(), options.palette, options.dither));
  }
  return selection;
}

}  // namespace voxeld
