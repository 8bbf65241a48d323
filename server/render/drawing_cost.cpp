#include "server/render/drawing_cost.h"

#include <algorithm>

#include "server/grid/tile_source.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

static_assert(kDrawnBrickBytes == RAYMARCH_BRICK_WORDS * sizeof(uint32_t));

void DrawingCost::add(const SparseTile& tile) {
  ++tiles_;
  bricks_ += tile.masks.size();
  full_ += tile.full.size();
  values_ += std::max(
      {tile.color.size() / 4, tile.normal.size() / 3, tile.label.size(), tile.material.size()});
  tile_bytes_ += tile_bytes(tile);
}

// At least four bricks of a surface share a block's table. A tile has no more tables than blocks.
size_t DrawingCost::node_bytes() const {
  const size_t blocks =
      std::min(bricks_ / 4 + full_ + tiles_, tiles_ * size_t{RAYMARCH_TILE_ENTRIES});
  return sizeof(uint32_t) * (tiles_ * RAYMARCH_TILE_ENTRIES + blocks * RAYMARCH_BLOCK_WORDS);
}

bool DrawingCost::fits(const ImageLimits& limits) const {
  const size_t largest =
      std::max({bricks_ * kDrawnBrickBytes, node_bytes(), values_ * sizeof(uint32_t)});
  return largest <= limits.table_bytes_max && bytes() <= limits.bytes_max;
}

size_t DrawingCost::bytes() const {
  return tile_bytes_ + bricks_ * kDrawnBrickBytes + node_bytes() + 2 * values_ * sizeof(uint32_t);
}

}  // namespace voxeld
