#include "server/formats/bricks/brick_index.h"

#include <algorithm>

#include "server/grid/tile_source.h"

namespace voxeld::mesh {

BrickIndex::BrickIndex(std::vector<std::array<int32_t, 3>> coords) {
  std::ranges::sort(coords, {}, coord_order);
  coords.erase(std::unique(coords.begin(), coords.end()), coords.end());
  tiles_.resize(coords.size());
  for (size_t i = 0; i < coords.size(); ++i) tiles_[i].coord = coords[i];
  for (Tile& tile : tiles_) {
    size_t at = 0;
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          tile.around[at++] = find_tile({tile.coord[0] + x, tile.coord[1] + y, tile.coord[2] + z});
        }
      }
    }
  }
}

void BrickIndex::number_bricks() {
  size_ = 0;
  for (Tile& tile : tiles_) {
    tile.first = size_;
    for (size_t row = 0; row < tile.rows.size(); ++row) {
      tile.before[row] = static_cast<uint16_t>(size_ - tile.first);
      size_ += static_cast<uint32_t>(std::popcount(tile.rows[row]));
    }
  }
}

uint32_t BrickIndex::find_tile(const std::array<int32_t, 3>& coord) const {
  if (std::ranges::min(coord) < 0) return kNone;
  const uint32_t order = coord_order(coord);
  const auto found = std::ranges::lower_bound(tiles_, order, {},
                                              [](const Tile& t) { return coord_order(t.coord); });
  if (found == tiles_.end() || found->coord != coord) return kNone;
  return static_cast<uint32_t>(found - tiles_.begin());
}

BrickPlace BrickIndex::place(size_t tile, int x, int y, int z) const {
  // -1 for bricks before the tile, 0 in it, 1 behind it.
  const int dx = x >> 5, dy = y >> 5, dz = z >> 5;
  const int around = 13 + dx + 3 * dy + 9 * dz;
  return {tiles_[tile].around[static_cast<size_t>(around)], x & (kTileBricks - 1),
          y & (kTileBricks - 1), z & (kTileBricks - 1)};
}

}  // namespace voxeld::mesh
