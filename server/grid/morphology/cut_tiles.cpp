#include "server/grid/morphology/cut_tiles.h"

#include <algorithm>
#include <array>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/grid/tile_appender.h"

namespace voxeld {
namespace {

bool is_transparent(const uint8_t* rgba) {
  return rgba[3] == 0 && (rgba[0] | rgba[1] | rgba[2]) != 0;
}

}  // namespace

bool colors_have_alpha(const OutputOptions& options) {
  constexpr std::array kWithoutAlpha = {Format::kVox,       Format::kXyz, Format::kObj,
                                        Format::kPcd,       Format::kQb,  Format::kSchem,
                                        Format::kLitematic, Format::kNbt, Format::kLdr};
  const bool has_instances =
      options.format == Format::kGlb && options.mesh == MeshSurface::kInstances;
  return !has_instances && std::ranges::count(kWithoutAlpha, options.format) == 0;
}

bool cuts_transparent(const OutputOptions& options) {
  if (options.alpha != AlphaRule::kAuto) return options.alpha == AlphaRule::kCut;
  return !colors_have_alpha(options);
}

bool has_transparent_voxels(const SparseTile& tile) {
  cancel_point();
  for (size_t i = 0; i + 4 <= tile.color.size(); i += 4) {
    if (is_transparent(&tile.color[i])) return true;
  }
  return false;
}

void cut_transparent_voxels(SparseTile& tile, const ChannelSet& channels) {
  if (!has_transparent_voxels(tile)) return;
  TileAppender kept(tile.coord, channels);
  for_each_voxel(tile, [&](int x, int y, int z, size_t index) {
    cancel_point();
    if (index != kNoAttributes && is_transparent(&tile.color[4 * index])) return;
    const auto in_tile = [](int cell) {
      return static_cast<uint32_t>(cell & (limits::kTileSide - 1));
    };
    kept.add(morton_encode(in_tile(x), in_tile(y), in_tile(z)), values_of(tile, index));
  });
  tile = kept.finish();
}

Grid without_transparent_voxels(const Grid& grid) {
  Grid kept;
  kept.spec = grid.spec;
  kept.channels = grid.channels;
  kept.meta = grid.meta;
  for (SparseTile tile : grid.tiles) {
    cut_transparent_voxels(tile, kept.channels);
    if (!tile.empty()) kept.tiles.push_back(std::move(tile));
  }
  return kept;
}

CutTiles::CutTiles(const TileSource& source) : source_(source) {
  grid_ = source.grid();
  coords_ = source.coords();
}

Result<SparseTile> CutTiles::tile(size_t index) const {
  VOXELD_ASSIGN(SparseTile tile, source_.tile(index));
  cut_transparent_voxels(tile, grid_.channels);
  return tile;
}

}  // namespace voxeld
