#include "server/grid/color/palette_tiles.h"

#include <algorithm>
#include <utility>

#include "server/base/check.h"
#include "server/grid/color/palette_entries.h"

namespace voxeld {

PaletteTiles::PaletteTiles(const TileSource& source, std::vector<Rgb> colors, Dither dither)
    : source_(source), colors_(std::move(colors)), dither_(dither) {
  VOXELD_CHECK(source.grid().channels.color, "a palette is for grids with colours");
  grid_ = source.grid();
  coords_ = source.coords();
}

Result<SparseTile> PaletteTiles::tile(size_t index) const {
  constexpr size_t kComponents = 4;
  VOXELD_ASSIGN(SparseTile tile, source_.tile(index));
  const std::vector<uint8_t> entries = choose_tile_entries(
      tile, colors_, dither_, [](const SparseTile& of, size_t voxel) -> uint32_t {
        if (!has_own_color(of, voxel)) return kNoColorKey;
        const uint8_t* color = &of.color[kComponents * voxel];
        return color[0] | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16;
      });
  for (size_t voxel = 0; voxel < entries.size(); ++voxel) {
    if (!has_own_color(tile, voxel)) continue;  // (0,0,0,0) stays the sign of none
    std::ranges::copy(colors_[entries[voxel]], &tile.color[kComponents * voxel]);
  }
  return tile;
}

}  // namespace voxeld
