#include "proto/codec/sparse_tile.h"

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
  std::vector<std::array<int64_t, 4>> visits;
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    visits.push_back({x, y, z, static_cast<int64_t>(voxel)});
  });
  const std::vector<std::array<int64_t, 4>> expected = {
      {256, 0, 512, 0}, {257, 0, 512, 1}, {257, 1, 512, 2}, {511, 15, 519, 3}};
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
  for_each_voxel(tiles[0], [&](int x, int y, int z, size_t voxel) {
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

TEST(SparseTile, a_visit_meets_the_voxels_of_full_nodes_in_order_and_without_attributes) {
  SparseTile tile;
  tile.brick_morton = {7, 72};
  tile.masks.resize(2);
  tile.masks[0].words[0] = 0b11;
  tile.masks[1].words[3] = 1;
  tile.full = {{0, 0}, {8, 1}, {64, 1}, {73, 0}};
  EXPECT_EQ(tile.voxel_count(), 3u + 18 * 512);
  EXPECT_EQ(tile.attribute_count(), 3u);
  int64_t before = -1;
  size_t visits = 0;
  std::vector<size_t> with_attributes;
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    const int64_t code =
        interleaved(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    EXPECT_LT(before, code);
    before = code;
    ++visits;
    if (voxel != kNoAttributes) with_attributes.push_back(voxel);
  });
  EXPECT_EQ(visits, tile.voxel_count());
  EXPECT_EQ(with_attributes, (std::vector<size_t>{0, 1, 2}));
}

SparseTile tile_of_full_bricks(uint32_t first, uint32_t count) {
  SparseTile tile;
  for (uint32_t b = first; b < first + count; ++b) {
    tile.brick_morton.push_back(b);
    tile.masks.emplace_back().words.fill(~uint64_t{0});
  }
  return tile;
}

TEST(SparseTile, canonical_full_nodes_are_as_large_as_can_be) {
  SparseTile whole = tile_of_full_bricks(0, 32768);
  canonicalize(whole);
  EXPECT_TRUE(whole.masks.empty());
  EXPECT_EQ(whole.full, (std::vector<FullNode>{{0, kTileLevels}}));

  SparseTile some = tile_of_full_bricks(5, 70);  // 5 6 7, 8 to 71, 72 to 74
  some.masks[0].words[2] = 1;
  const size_t voxels = some.voxel_count();
  canonicalize(some);
  EXPECT_EQ(some.brick_morton, (std::vector<uint32_t>{5}));
  const std::vector<FullNode> expected = {{6, 0},  {7, 0},  {8, 1},  {16, 1}, {24, 1},
                                          {32, 1}, {40, 1}, {48, 1}, {56, 1}, {64, 1},
                                          {72, 0}, {73, 0}, {74, 0}};
  EXPECT_EQ(some.full, expected);
  EXPECT_EQ(some.voxel_count(), voxels);
  const SparseTile before = some;
  canonicalize(some);
  EXPECT_EQ(some, before);
}

TEST(SparseTile, a_gap_keeps_full_nodes_apart) {
  SparseTile tile = tile_of_full_bricks(64, 64);
  tile.masks[9].words[0] ^= 1;
  canonicalize(tile);
  EXPECT_EQ(tile.masks.size(), 1u);
  EXPECT_EQ(tile.full.size(), 7u + 7u);
  tile = tile_of_full_bricks(1, 15);
  canonicalize(tile);
  EXPECT_EQ(tile.full.size(), 7u + 1u);
}

TEST(SparseTile, masks_with_attributes_stay_masks) {
  SparseTile tile = tile_of_full_bricks(0, 8);
  tile.color.resize(4 * tile.attribute_count());
  tile.full = {{8, 1}, {16, 0}, {17, 0}, {18, 0}, {19, 0}, {20, 0}, {21, 0}, {22, 0}, {23, 0}};
  canonicalize(tile);
  EXPECT_EQ(tile.masks.size(), 8u);
  EXPECT_EQ(tile.full, (std::vector<FullNode>{{8, 1}, {16, 1}}));
}

}  // namespace
}  // namespace voxeld
