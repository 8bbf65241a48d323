#include "server/grid/region.h"

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "server/base/check.h"
#include "server/grid/level.h"
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
  // `low`, `high`: cells of the source that the tile covers.
  Canvas(const glm::ivec3& low, const glm::ivec3& high)
      : low_(low), high_(high), masks_(kTileBricks) {}

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
      if (index != kNoAttributes) values_[number_of(code)] = values_of(tile, index);
    });
  }

  SparseTile finish(const TileCoord& coord, const ChannelSet& channels) const {
    TileAppender out(coord, channels);
    size_t voxel = 0;
    for (size_t brick = 0; brick < kTileBricks; ++brick) {
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
      const glm::ivec3 cell(x, y, z);
      if (glm::any(glm::lessThan(cell, low_)) || glm::any(glm::greaterThanEqual(cell, high_))) {
        return;
      }
      const glm::uvec3 at(cell - low_);
      visit(morton_encode(at.x, at.y, at.z), index);
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

  glm::ivec3 low_, high_;
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

RegionTiles::RegionTiles(const TileSource& source, const CellBox& box)
    : cached_(source), box_(box) {
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
    const glm::ivec3 first = low / limits::kTileSide, last = (high - 1) / limits::kTileSide;
    for (int z = first.z; z <= last.z; ++z) {
      for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) coords_.push_back({x, y, z});
      }
    }
  }
  std::ranges::sort(coords_, {}, [](const TileCoord& coord) { return coord_order(coord); });
  coords_.erase(std::unique(coords_.begin(), coords_.end()), coords_.end());
}

Result<std::vector<SparseTile>> RegionTiles::sources_of(const TileCoord& coord) const {
  const glm::ivec3 low = first_cell(coord) + box_.min;
  const glm::ivec3 high = glm::min(low + limits::kTileSide, box_.max);
  const glm::ivec3 first = low / limits::kTileSide, last = (high - 1) / limits::kTileSide;
  const auto& all = cached_.coords();
  const auto order = [](const TileCoord& c) { return coord_order(c); };
  std::vector<SparseTile> tiles;
  for (int z = first.z; z <= last.z; ++z) {
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        const TileCoord wanted = {x, y, z};
        const auto at = std::ranges::lower_bound(all, coord_order(wanted), {}, order);
        if (at == all.end() || *at != wanted) continue;
        VOXELD_ASSIGN(SparseTile tile, cached_.tile(static_cast<size_t>(at - all.begin())));
        tiles.push_back(std::move(tile));
      }
    }
  }
  return tiles;
}

Result<SparseTile> RegionTiles::tile(size_t index) const {
  const TileCoord& coord = coords_[index];
  VOXELD_ASSIGN(const std::vector<SparseTile> sources, sources_of(coord));
  const glm::ivec3 low = first_cell(coord) + box_.min;
  Canvas canvas(low, glm::min(low + limits::kTileSide, box_.max));
  for (const SparseTile& source : sources) canvas.mark(source);
  if (grid_.channels.any()) {
    canvas.number_voxels();
    for (const SparseTile& source : sources) canvas.copy_values(source);
  }
  return canvas.finish(coord, grid_.channels);
}

bool selects(const OutputOptions& options) {
  return options.level > 0 || options.region.has_value();
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

Result<Selection> Selection::open(const TileSource& source, const OutputOptions& options) {
  Selection selection;
  selection.last_ = &source;
  VOXELD_ASSIGN(selection.box_, region_at_level(source.grid().spec, options, options.level));
  const CellBox& box = selection.box_;
  const auto push = [&](std::unique_ptr<TileSource> stage) {
    selection.last_ = stage.get();
    selection.stages_.push_back(std::move(stage));
  };
  if (options.region) {
    // Only whole tiles under the region's cubes; other tiles are never read.
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
    push(std::make_unique<LevelTiles>(selection.tiles(), options.level, options.level_rule));
  }
  if (options.region) push(std::make_unique<RegionTiles>(selection.tiles(), box));
  return selection;
}

}  // namespace voxeld
