#include "server/render/drawing_cost.h"

#include <algorithm>
#include <bitset>

#include "server/grid/tile_source.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {

static_assert(kDrawnBrickBytes == RAYMARCH_BRICK_WORDS * sizeof(uint32_t));

namespace {

// A block is a node of this level.
constexpr uint32_t kBlockLevel = RAYMARCH_BLOCK_SHIFT - RAYMARCH_BRICK_SHIFT;
static_assert(1 << (3 * kBlockLevel) == RAYMARCH_BLOCK_ENTRIES);

// Blocks of the tile that get a table: those that are neither empty nor full.
size_t blocks_with_table(const SparseTile& tile) {
  std::bitset<RAYMARCH_TILE_ENTRIES> blocks;
  for (const FullNode& node : tile.full) {
    if (node.level < kBlockLevel) blocks.set(node.brick_morton / RAYMARCH_BLOCK_ENTRIES);
  }
  for (const uint32_t brick : tile.brick_morton) blocks.set(brick / RAYMARCH_BLOCK_ENTRIES);
  return blocks.count();
}

}  // namespace

void DrawingCost::add(const SparseTile& tile) {
  ++tiles_;
  bricks_ += tile.masks.size();
  blocks_ += blocks_with_table(tile);
  values_ += std::max(
      {tile.color.size() / 4, tile.normal.size() / 3, tile.label.size(), tile.material.size()});
  tile_bytes_ += tile_bytes(tile);
}

size_t DrawingCost::node_bytes() const {
  return sizeof(uint32_t) * (tiles_ * RAYMARCH_TILE_ENTRIES + blocks_ * RAYMARCH_BLOCK_WORDS);
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
