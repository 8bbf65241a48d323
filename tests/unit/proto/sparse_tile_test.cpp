#include "proto/sparse_tile.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

// Bit by bit, as the format's description says.
uint32_t interleaved(uint32_t x, uint32_t y, uint32_t z) {
  uint32_t code = 0;
  for (uint32_t bit = 0; bit < 10; ++bit) {
    code |= (x >> bit & 1) << (3 * bit) | (y >> bit & 1) << (3 * bit + 1) |
            (z >> bit & 1) << (3 * bit + 2);
  }
  return code;
}

TEST(Morton, codes_interleave_bits_with_x_lowest) {
  EXPECT_EQ(morton_encode(1, 0, 0), 1u);
  EXPECT_EQ(morton_encode(0, 1, 0), 2u);
  EXPECT_EQ(morton_encode(0, 0, 1), 4u);
  EXPECT_EQ(morton_encode(2, 0, 0), 8u);
  EXPECT_EQ(morton_encode(1023, 1023, 1023), (1u << 30) - 1);
  for (uint32_t i = 0; i < 1024; ++i) {
    const uint32_t x = i, y = i * 7 % 1024, z = i * 613 % 1024;
    EXPECT_EQ(morton_encode(x, y, z), interleaved(x, y, z));
  }
}

TEST(Morton, decoding_gives_the_coordinates_back) {
  for (uint32_t i = 0; i < 1024; ++i) {
    const std::array<uint32_t, 3> cell = {i, 1023 - i, i * 613 % 1024};
    EXPECT_EQ(morton_decode(morton_encode(cell[0], cell[1], cell[2])), cell);
  }
}

TEST(SparseTile, counts_the_set_bits_of_all_bricks) {
  SparseTile tile;
  EXPECT_EQ(tile.voxel_count(), 0u);
  tile.brick_morton = {0, 5};
  tile.masks.resize(2);
  tile.masks[0].words = {1, 0, 0, 0, 0, 0, 0, uint64_t{1} << 63};
  tile.masks[1].words.fill(~uint64_t{0});
  EXPECT_EQ(tile.voxel_count(), 2u + 512u);
}

TEST(SparseTile, a_visit_gives_cells_of_the_grid_in_storage_order) {
  SparseTile tile;
  tile.coord = {1, 0, 2};
  tile.brick_morton = {0, morton_encode(31, 1, 0)};
  tile.masks.resize(2);
  tile.masks[0].words[0] = 0b1011;             // cells 0, 1 and 3 of the brick
  tile.masks[1].words[7] = uint64_t{1} << 63;  // its last cell
  std::vector<std::array<int64_t, 5>> visits;
  for_each_voxel(tile, [&](size_t brick, int x, int y, int z, size_t voxel) {
    visits.push_back({static_cast<int64_t>(brick), x, y, z, static_cast<int64_t>(voxel)});
  });
  const std::vector<std::array<int64_t, 5>> expected = {
      {0, 256, 0, 512, 0}, {0, 257, 0, 512, 1}, {0, 257, 1, 512, 2}, {1, 511, 15, 519, 3}};
  EXPECT_EQ(visits, expected);
}

TEST(SparseTile, a_visit_meets_every_voxel_once_in_ascending_morton_order) {
  std::mt19937 random(7);
  const auto voxels = test::random_voxels(random, {256, 256, 256}, 5000);
  std::set<std::array<int, 3>> expected;
  for (const auto& voxel : voxels) expected.insert(voxel.cell);
  const auto tiles = test::tiles_of(voxels, false, false);
  ASSERT_EQ(tiles.size(), 1u);

  std::set<std::array<int, 3>> met;
  int64_t before = -1;
  size_t next = 0;
  for_each_voxel(tiles[0], [&](size_t, int x, int y, int z, size_t voxel) {
    const int64_t code =
        interleaved(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    EXPECT_LT(before, code);
    before = code;
    EXPECT_EQ(voxel, next++);
    EXPECT_TRUE(met.insert({x, y, z}).second);
  });
  EXPECT_EQ(met, expected);
  EXPECT_EQ(tiles[0].voxel_count(), expected.size());
}

}  // namespace
}  // namespace voxeld
