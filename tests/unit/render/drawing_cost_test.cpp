// The memory that is foreseen against the tables that are made.
#include "server/render/drawing_cost.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "proto/limits.h"
#include "server/grid/tile_source.h"
#include "server/render/packed_grid.h"

namespace voxeld {
namespace {

// One voxel in the first brick of each block: no two bricks share a block's table.
Grid scattered() {
  Grid grid;
  grid.spec.dims = glm::ivec3(limits::kTileSide);
  SparseTile tile;
  for (uint32_t block = 0; block < 512; ++block) {
    tile.brick_morton.push_back(64 * block);
    tile.masks.emplace_back();
    tile.masks.back().words[0] = 1;
  }
  grid.tiles = {tile};
  return grid;
}

// The cost without the tile itself.
size_t table_bytes(const Grid& grid) {
  DrawingCost cost;
  size_t bytes = 0;
  for (const SparseTile& tile : grid.tiles) {
    cost.add(tile);
    bytes += tile_bytes(tile);
  }
  return cost.bytes() - bytes;
}

TEST(DrawingCost, is_not_less_than_the_tables_of_scattered_bricks) {
  const Grid grid = scattered();
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  const size_t entries = packed->nodes.size() - 1;  // without that of the tile
  EXPECT_EQ(table_bytes(grid), sizeof(uint32_t) * (entries + packed->bricks.size()));
  DrawingCost cost;
  cost.add(grid.tiles[0]);
  EXPECT_TRUE(cost.fits({.table_bytes_max = entries * sizeof(uint32_t)}));
  EXPECT_FALSE(cost.fits({.table_bytes_max = entries * sizeof(uint32_t) - 1}));
}

// The march on the CPU multiplies the number of a brick by its 20 words in signed 32 bits.
TEST(DrawingCost, of_more_than_107_million_bricks_never_fits) {
  SparseTile tile;
  for (uint32_t brick = 0; brick < 32768; ++brick) tile.brick_morton.push_back(brick);
  tile.masks.resize(tile.brick_morton.size());
  const ImageLimits all_memory{.bytes_max = SIZE_MAX};
  DrawingCost cost;
  for (int i = 0; i < 3276; ++i) cost.add(tile);  // 107,347,968 bricks
  EXPECT_TRUE(cost.fits(all_memory));
  cost.add(tile);
  EXPECT_FALSE(cost.fits(all_memory));
}

}  // namespace
}  // namespace voxeld
