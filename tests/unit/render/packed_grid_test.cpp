// The tables that the ray march reads.
#include "server/render/packed_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "server/base/cancel_point.h"
#include "server/render/hull.h"
#include "shaders/shared/raymarch.h"
#include "tests/unit/base/points_passed.h"

namespace voxeld {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

// Two voxels in one brick and one in another tile.
Grid three_voxels() {
  Grid grid;
  grid.spec.dims = {300, 17, 9};
  grid.channels.color = grid.channels.normal = true;
  SparseTile near;
  near.brick_morton = {morton_encode(4, 1, 0)};  // cells x 32..39, y 8..15
  near.masks.resize(1);
  near.masks[0].words[0] = 1;                  // cell 32,8,0
  near.masks[0].words[7] = uint64_t{1} << 63;  // cell 39,15,7
  near.color = {1, 2, 3, 4, 5, 6, 7, 8};
  near.normal = {127, 0, -127, 0, 1, -1};
  SparseTile far;
  far.coord = {1, 0, 0};
  far.brick_morton = {morton_encode(0, 0, 1)};  // cells x 256..263, z 8..15
  far.masks.resize(1);
  far.masks[0].words[0] = 2;  // cell 257,0,8
  far.color = {9, 10, 11, 12};
  far.normal = {0, 0, 127};
  grid.tiles = {near, far};
  return grid;
}

// The entry of the tables for a cell.
uint32_t entry_of(const PackedGrid& packed, const glm::ivec3& cell) {
  const glm::ivec3 tile = cell / 256, block = cell / 32 % 8, brick = cell / 8 % 4;
  const auto at = [&](size_t table, const glm::ivec3& p, const glm::ivec3& dims) {
    return packed.nodes[table + static_cast<size_t>(p.x + dims.x * (p.y + dims.y * p.z))];
  };
  uint32_t entry = at(0, tile, packed.tile_dims);
  if ((entry & RAYMARCH_CHILD) == 0) return entry;
  entry = at(entry & ~RAYMARCH_CHILD, block, glm::ivec3(8));
  if ((entry & RAYMARCH_CHILD) == 0) return entry;
  return at(entry & ~RAYMARCH_CHILD, brick, glm::ivec3(4));
}

TEST(PackGrid, ids_are_colours_where_there_are_no_others) {
  Grid grid = three_voxels();
  grid.channels.label = true;
  grid.tiles[0].label = {1, 0};
  grid.tiles[1].label = {7};
  EXPECT_EQ(pack_grid(grid)->colors[0], 0x04030201u) << "colours of its own";
  grid.channels.color = false;
  for (SparseTile& tile : grid.tiles) tile.color.clear();
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_TRUE(packed->has_color);
  const auto word = [](uint16_t id) {
    const auto rgb = id_color(id);
    return 0xff000000u | unsigned{rgb[2]} << 16 | unsigned{rgb[1]} << 8 | rgb[0];
  };
  EXPECT_THAT(packed->colors, ElementsAre(word(1), word(0), word(7)));
  EXPECT_EQ(packed->bricks[RAYMARCH_BRICK_WORDS + RAYMARCH_BRICK_COLOR], word(7));
  grid.channels.label = false;
  grid.channels.material = true;
  for (SparseTile& tile : grid.tiles) tile.material.swap(tile.label);
  EXPECT_THAT(pack_grid(grid)->colors, ElementsAre(word(1), word(0), word(7)));
}

TEST(PackGrid, bricks_are_found_through_the_tables_of_tile_and_block) {
  const auto packed = pack_grid(three_voxels());
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->tile_dims, glm::ivec3(2, 1, 1));
  EXPECT_EQ(packed->nodes.size(), 2u + 2 * RAYMARCH_TILE_ENTRIES + 2 * RAYMARCH_BLOCK_WORDS);
  EXPECT_EQ(packed->bricks.size(), 2u * RAYMARCH_BRICK_WORDS);
  EXPECT_EQ(entry_of(*packed, {32, 8, 0}), RAYMARCH_CHILD | 0u);
  EXPECT_EQ(entry_of(*packed, {39, 15, 7}), RAYMARCH_CHILD | 0u);
  EXPECT_EQ(entry_of(*packed, {257, 0, 8}), RAYMARCH_CHILD | 1u);
  const uint32_t* first = packed->bricks.data();
  const uint32_t* second = first + RAYMARCH_BRICK_WORDS;
  EXPECT_EQ(first[0], 1u);
  EXPECT_EQ(first[15], 0x80000000u);
  EXPECT_EQ(first[RAYMARCH_BRICK_FIRST], 0u);
  EXPECT_EQ(first[RAYMARCH_BRICK_NODES], 0x81u);
  EXPECT_EQ(second[0], 2u);
  EXPECT_EQ(second[RAYMARCH_BRICK_FIRST], 2u);
}

TEST(PackGrid, empty_entries_tell_the_largest_aligned_cube_around_them) {
  const auto packed = pack_grid(three_voxels());
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(entry_of(*packed, {40, 8, 0}), 3u);    // beside the brick
  EXPECT_EQ(entry_of(*packed, {48, 8, 0}), 4u);    // the other 2^3 bricks of the block
  EXPECT_EQ(entry_of(*packed, {0, 0, 0}), 5u);     // the block before it
  EXPECT_EQ(entry_of(*packed, {64, 0, 0}), 6u);    // 2^3 blocks
  EXPECT_EQ(entry_of(*packed, {128, 0, 0}), 7u);   // 4^3 blocks
  EXPECT_EQ(entry_of(*packed, {299, 16, 8}), 5u);  // of the other tile
}

TEST(PackGrid, empty_tiles_join_to_cubes_and_cost_four_bytes) {
  Grid grid;
  grid.spec.dims = glm::ivec3(16384);
  SparseTile tile;
  tile.coord = {63, 0, 0};
  tile.brick_morton = {0};
  tile.masks.resize(1);
  tile.masks[0].words[0] = 1;
  grid.tiles = {tile};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->nodes.size(), 64u * 64 * 64 + RAYMARCH_TILE_ENTRIES + RAYMARCH_BLOCK_WORDS);
  EXPECT_EQ(entry_of(*packed, {62 * 256, 0, 0}), 8u);
  EXPECT_EQ(entry_of(*packed, {61 * 256, 0, 0}), 9u);
  EXPECT_EQ(entry_of(*packed, {63 * 256, 300, 0}), 8u);
  EXPECT_EQ(entry_of(*packed, {8191, 0, 0}), 13u);
  EXPECT_EQ(entry_of(*packed, {16383, 16383, 16383}), 13u);
  EXPECT_EQ(packed->occupied_min, glm::ivec3(16128, 0, 0));
}

TEST(PackGrid, full_nodes_are_one_mark_at_the_largest_part_that_they_cover) {
  Grid grid;
  grid.spec.dims = {1024, 256, 256};
  std::vector<SparseTile> tiles(4);
  for (int i = 0; i < 4; ++i) tiles[static_cast<size_t>(i)].coord = {i, 0, 0};
  tiles[0].full = {{0, kTileLevels}};
  tiles[1].full = {{7 * 512, 3}};  // 64^3 cells from brick 8,8,8
  tiles[2].full = {{8, 1}};        // bricks 2..3, 0..1, 0..1
  tiles[3].full = {{64, 2}, {129, 0}};
  grid.tiles = tiles;
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(entry_of(*packed, {0, 0, 0}), RAYMARCH_FULL);
  EXPECT_EQ(packed->nodes[0], RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {256 + 64, 64, 64}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {256 + 127, 127, 127}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {256 + 63, 64, 64}), 6u);
  EXPECT_EQ(entry_of(*packed, {512 + 16, 0, 0}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {512 + 31, 15, 15}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {512 + 15, 0, 0}), 4u);
  EXPECT_EQ(entry_of(*packed, {768 + 63, 31, 31}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {768 + 8, 32, 0}), RAYMARCH_FULL);
  EXPECT_EQ(entry_of(*packed, {768 + 0, 32, 0}), 3u);
  EXPECT_FALSE(packed->full_color.has_value());  // no voxel has a colour
  // Three tables of tiles and two of blocks, and no brick.
  EXPECT_EQ(packed->nodes.size(), 4u + 3 * RAYMARCH_TILE_ENTRIES + 2 * RAYMARCH_BLOCK_WORDS);
  EXPECT_TRUE(packed->bricks.empty());
  EXPECT_EQ(packed->attribute_count, 0u);
  EXPECT_EQ(packed->occupied_min, glm::ivec3(0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(768 + 64, 256, 256));
}

TEST(PackGrid, attributes_and_the_occupied_box_follow_the_voxels) {
  const auto packed = pack_grid(three_voxels());
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->attribute_count, 3u);
  EXPECT_THAT(packed->colors, ElementsAre(0x04030201u, 0x08070605u, 0x0c0b0a09u));
  EXPECT_THAT(packed->normals, ElementsAre(0x0081007fu, 0x00ff0100u, 0x007f0000u));
  EXPECT_EQ(packed->occupied_min, glm::ivec3(32, 0, 0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(258, 16, 9));
}

TEST(PackGrid, full_nodes_get_the_mean_colour_of_the_voxels_that_have_one) {
  Grid grid = three_voxels();
  grid.tiles[0].color = {255, 0, 10, 255, 255, 0, 10, 255};
  grid.tiles[1].color = {255, 0, 10, 255};
  EXPECT_FALSE(pack_grid(grid)->full_color.has_value());
  grid.tiles[0].full = {{morton_encode(2, 0, 0), 1}};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  ASSERT_TRUE(packed->full_color.has_value());
  EXPECT_THAT(*packed->full_color, ElementsAre(255, 0, 10));
  EXPECT_EQ(packed->colors.size(), 3u);
}

TEST(PackGrid, bricks_and_blocks_keep_the_means_of_their_voxels) {
  Grid grid = three_voxels();
  grid.tiles[0].color = {255, 0, 10, 255, 0, 0, 10, 255};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  // Half of full linear light is sRGB 188.
  EXPECT_EQ(packed->bricks[RAYMARCH_BRICK_COLOR], 0xff0a00bcu);
  EXPECT_EQ(packed->bricks[RAYMARCH_BRICK_NORMAL], 0x00c0003fu);  // 63, 0, -64
  const uint32_t tile = packed->nodes[0] & ~RAYMARCH_CHILD;
  const uint32_t block = packed->nodes[tile + 1] & ~RAYMARCH_CHILD;
  EXPECT_EQ(packed->nodes[block + RAYMARCH_BLOCK_COLOR], 0xff0a00bcu);
  EXPECT_EQ(packed->nodes[block + RAYMARCH_BLOCK_NORMAL], 0x00c0003fu);
}

TEST(PackGrid, voxels_inside_get_the_mean_colour_and_are_no_part_of_means) {
  Grid grid = three_voxels();
  grid.tiles[0].color = {255, 0, 10, 255, 0, 0, 0, 0};
  grid.tiles[1].color = {0, 0, 0, 0};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_THAT(packed->colors, ElementsAre(0xff0a00ffu, 0x000a00ffu, 0x000a00ffu));
  EXPECT_THAT(*packed->full_color, ElementsAre(255, 0, 10));
  EXPECT_EQ(packed->bricks[RAYMARCH_BRICK_COLOR], 0xff0a00ffu);
  EXPECT_EQ(packed->bricks[RAYMARCH_BRICK_WORDS + RAYMARCH_BRICK_COLOR], 0x000a00ffu);
  EXPECT_NEAR(packed->luminance, 0.2126 + 0.0722 * 0.003035, 1e-4);
  const uint32_t tile = packed->nodes[0] & ~RAYMARCH_CHILD;
  const uint32_t block = packed->nodes[tile + 1] & ~RAYMARCH_CHILD;
  EXPECT_EQ(packed->nodes[block + RAYMARCH_BLOCK_COLOR], 0xff0a00ffu);
}

TEST(PackGrid, can_be_cancelled) {
  const Grid grid = three_voxels();
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW((void)pack_grid(grid), Cancelled);
  EXPECT_THROW((void)hull_points(grid), Cancelled);
}

TEST(PackGrid, tables_that_grow_can_be_cancelled) {
  Grid grid;
  grid.spec.dims = {256, 256, 256};
  SparseTile& tile = grid.tiles.emplace_back();
  for (uint32_t block = 0; block < 512; ++block) tile.full.push_back({64 * block, 0});
  const int hull = test::points_passed([&] { (void)hull_points(grid); });
  const int packed = test::points_passed([&] { EXPECT_TRUE(pack_grid(grid).ok()); });
  EXPECT_GE(packed, hull + 5);
}

TEST(PackGrid, an_empty_grid_is_framed_whole) {
  Grid grid;
  grid.spec.dims = {5, 6, 7};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->occupied_min, glm::ivec3(0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(5, 6, 7));
  EXPECT_TRUE(packed->bricks.empty());
  EXPECT_THAT(packed->nodes, Each(8u));
}

}  // namespace
}  // namespace voxeld
