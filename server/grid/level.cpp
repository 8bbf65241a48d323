#include "server/grid/level.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/limits.h"
#include "server/base/check.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"
#include "server/grid/level_cells.h"
#include "server/grid/tile_appender.h"

namespace voxeld {
namespace {

constexpr int kTileBits = 8;
static_assert(limits::kTileSide == 1 << kTileBits);

// The least number of source tiles to decode before their cells are merged.
constexpr size_t kTilesAtATimeMin = 8;

// The Morton code, in the level's tile, at which the cells of a source tile begin.
uint32_t first_code(const TileCoord& coord, int level) {
  std::array<uint32_t, 3> cell{};  // of the level
  for (size_t c = 0; c < 3; ++c) {
    const auto at = static_cast<uint32_t>(coord[c]);
    cell[c] = (level <= kTileBits ? at << (kTileBits - level) : at >> (level - kTileBits)) & 255u;
  }
  return morton_encode(cell[0], cell[1], cell[2]);
}

// The thickness of a band in voxels of the level. By majority half of it counts, since its rim is
// lost, and none where voxels that the grid's end cuts have too few cells for a majority.
double level_band_voxels(double thickness, const glm::ivec3& dims, int level, LevelRule rule) {
  const double voxels = std::ldexp(thickness, -level);
  if (rule == LevelRule::kAny) return voxels;
  const int rest = (1 << level) - 1;
  const bool is_whole = ((dims.x | dims.y | dims.z) & rest) == 0;
  return is_whole ? voxels / 2 : 0;
}

}  // namespace

// The contribution of one source tile.
struct LevelTiles::Part {
  Status status;
  std::vector<uint32_t> codes;      // of voxels of the level, in its tile
  std::vector<VoxelValues> values;  // if the grid has channels
  LevelSums sums;                   // if the tile is a part of a single voxel
};

GridSpec level_spec(const GridSpec& spec, int level) {
  GridSpec out = spec;
  for (int c = 0; c < 3; ++c) {
    out.dims[c] = ((spec.dims[c] - 1) >> level) + 1;
    out.voxel_size[c] = std::ldexp(spec.voxel_size[c], level);
  }
  return out;
}

LevelTiles::LevelTiles(const TileSource& source, int level, LevelRule rule)
    : source_(source),
      level_(level),
      is_solid_(source.grid().meta.is_solid()),
      cells_min_(rule == LevelRule::kAny ? 1 : uint64_t{1} << (3 * level - 1)) {
  VOXELD_CHECK(level >= 1 && level <= kLevelMax, "levels are 1 to 14");
  const Grid& grid = source.grid();
  grid_.spec = level_spec(grid.spec, level);
  grid_.channels = grid.channels;
  if (grid.meta.is_band()) {
    grid_.meta = grid.meta.with_band_voxels(
        level_band_voxels(grid.meta.band_voxels(), grid.spec.dims, level, rule));
  } else {
    grid_.meta = grid.meta;
  }
  // Source tiles under one tile are consecutive in Morton order.
  for (size_t i = 0; i < source.coords().size(); ++i) {
    TileCoord coord = source.coords()[i];
    for (int32_t& c : coord) c >>= level;
    if (coords_.empty() || coords_.back() != coord) {
      coords_.push_back(coord);
      under_.emplace_back(i, i);
    }
    under_.back().second = i + 1;
  }
}

// Finished voxels if the tile has whole ones; otherwise the sums for its part of one voxel.
LevelTiles::Part LevelTiles::reduce(size_t at) const {
  Part part;
  const auto tile = source_.tile(at);
  if (!tile) {
    part.status = tile.error();
    return part;
  }
  const bool has_channels = grid_.channels.any();
  const uint32_t first = first_code(source_.coords()[at], level_);
  for_each_level_cell(*tile, level_, [&](uint32_t code, const LevelSums& sums) {
    if (level_ > kTileBits) {
      part.sums = sums;
      part.codes = {first};
    } else if (sums.cells >= cells_min_) {
      part.codes.push_back(first + code);
      if (has_channels) part.values.push_back(sums.mean(level_, is_solid_));
    }
  });
  return part;
}

Result<SparseTile> LevelTiles::tile(size_t index) const {
  TileAppender out(coords_[index], grid_.channels);
  LevelSums open;  // of a voxel that several tiles share
  uint32_t open_code = 0;
  const auto close = [&] {
    if (open.cells >= cells_min_) out.add(open_code, open.mean(level_, is_solid_));
    open = {};
  };
  const auto append = [&](const Part& part) {
    if (level_ <= kTileBits) {
      for (size_t i = 0; i < part.codes.size(); ++i) {
        cancel_point_at(i);
        out.add(part.codes[i], part.values.empty() ? VoxelValues{} : part.values[i]);
      }
    } else if (!part.codes.empty()) {
      if (part.codes[0] != open_code) close();
      open_code = part.codes[0];
      open.add(part.sums);
    }
  };
  const auto [begin, end] = under_[index];
  const size_t step = std::max(kTilesAtATimeMin, source_.batch());
  for (size_t at = begin; at < end; at += step) {
    std::vector<Part> parts(std::min(step, end - at));
    parallel_for(parts.size(), [&, at](size_t i) { parts[i] = reduce(at + i); });
    for (const Part& part : parts) {
      VOXELD_TRY(part.status);
      append(part);
    }
  }
  close();
  return out.finish();
}

}  // namespace voxeld
