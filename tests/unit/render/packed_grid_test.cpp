// The tables that the ray march reads.
#include "server/render/packed_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace voxeld {
namespace {

using ::testing::ElementsAre;

// Two voxels in one brick and one in another tile.
Grid three_voxels() {
  Grid grid;
  grid.spec.dims = {300, 17, 9};
  grid.has_color = grid.has_normal = true;
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

TEST(PackGrid, bricks_are_found_through_the_table_and_the_block_bits) {
  const auto packed = pack_grid(three_voxels());
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->brick_dims, glm::ivec3(38, 3, 2));
  EXPECT_EQ(packed->block_dims, glm::ivec3(10, 1, 1));
  ASSERT_EQ(packed->brick_index.size(), 38u * 3 * 2);
  for (size_t i = 0; i < packed->brick_index.size(); ++i) {
    const uint32_t wanted = i == 4 + 38 * 1 ? 1u : i == 32 + 38 * 3 ? 2u : 0u;
    EXPECT_EQ(packed->brick_index[i], wanted) << i;
  }
  EXPECT_THAT(packed->block_bits, ElementsAre(1u << 1 | 1u << 8));
  EXPECT_THAT(packed->brick_offsets, ElementsAre(0, 2));
  EXPECT_EQ(packed->brick_masks.size(), 32u);
  EXPECT_EQ(packed->brick_masks[0], 1u);
  EXPECT_EQ(packed->brick_masks[15], 0x80000000u);
  EXPECT_EQ(packed->brick_masks[16], 2u);
}

TEST(PackGrid, attributes_and_the_occupied_box_follow_the_voxels) {
  const auto packed = pack_grid(three_voxels());
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->voxel_count, 3u);
  EXPECT_THAT(packed->colors, ElementsAre(0x04030201u, 0x08070605u, 0x0c0b0a09u));
  EXPECT_THAT(packed->normals, ElementsAre(0x0081007fu, 0x00ff0100u, 0x007f0000u));
  EXPECT_EQ(packed->occupied_min, glm::ivec3(32, 0, 0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(258, 16, 9));
}

TEST(PackGrid, bricks_of_full_nodes_share_one_brick_with_the_mean_colour) {
  Grid grid = three_voxels();
  grid.spec.dims.z = 24;
  for (SparseTile& tile : grid.tiles) {
    for (size_t i = 0; i < tile.color.size(); ++i) tile.color[i] = static_cast<uint8_t>(i % 4);
  }
  grid.tiles[0].full = {{morton_encode(2, 0, 0), 1}, {morton_encode(5, 0, 2), 0}};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_THAT(packed->brick_offsets, ElementsAre(0, 512, 514));
  EXPECT_EQ(packed->brick_masks.size(), 48u);
  for (size_t i = 0; i < 16; ++i) EXPECT_EQ(packed->brick_masks[i], ~0u);
  ASSERT_EQ(packed->colors.size(), 515u);
  EXPECT_EQ(packed->colors[511], 0xff020100u);
  EXPECT_EQ(packed->colors[512], 0x03020100u);
  ASSERT_EQ(packed->normals.size(), 515u);
  EXPECT_EQ(packed->normals[0], 0u);
  for (size_t i = 0; i < packed->brick_index.size(); ++i) {
    const size_t x = i % 38, y = i / 38 % 3, z = i / (38 * 3);
    const bool full = (x / 2 == 1 && y < 2 && z < 2) || (x == 5 && y == 0 && z == 2);
    const uint32_t wanted = full                          ? 1
                            : x == 4 && y == 1 && z == 0  ? 2
                            : x == 32 && y == 0 && z == 1 ? 3
                                                          : 0;
    EXPECT_EQ(packed->brick_index[i], wanted) << i;
  }
  EXPECT_EQ(packed->occupied_min, glm::ivec3(16, 0, 0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(258, 16, 24));
}

TEST(PackGrid, an_empty_grid_is_framed_whole) {
  Grid grid;
  grid.spec.dims = {5, 6, 7};
  const auto packed = pack_grid(grid);
  ASSERT_TRUE(packed.ok());
  EXPECT_EQ(packed->occupied_min, glm::ivec3(0));
  EXPECT_EQ(packed->occupied_max, glm::ivec3(5, 6, 7));
  EXPECT_TRUE(packed->brick_masks.empty());
}

}  // namespace
}  // namespace voxeld
