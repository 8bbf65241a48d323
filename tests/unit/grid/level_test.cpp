// Levels of detail against the oracle, which finds every cube by itself.
#include "server/grid/level.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/grid/content_hash.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/grid/grid_cells.h"

namespace voxeld {
namespace {

using testing::Cell;
using testing::CellValues;

// The byte that a real number rounds to; a hair to either side where double precision decides.
void expect_rounded(int got, long double exact, const char* what) {
  EXPECT_LE(std::abs(static_cast<long double>(got) - exact), 0.501L) << what;
}

void expect_mean(const CellValues& got, const reference::LevelMean& mean) {
  if (mean.has_color) {
    // The mean is an integer of 16 bits before it becomes a byte.
    for (size_t c = 0; c < 3; ++c) {
      expect_rounded(got.color[c], reference::srgb255(std::floor(mean.color[c] + 0.5L)), "color");
    }
    expect_rounded(got.color[3], mean.color[3], "alpha");
  } else {
    EXPECT_EQ(got.color, (std::array<int, 4>{}));
  }
  for (size_t c = 0; c < 3; ++c) {
    expect_rounded(got.normal[c], mean.has_normal ? 127 * mean.normal[c] : 0, "normal");
  }
}

void expect_level(const Grid& grid, int level, LevelRule rule) {
  const GridTiles source(grid);
  const LevelTiles tiles(source, level, rule);
  auto expected =
      reference::level_oracle(testing::voxels_of(grid), level, rule == LevelRule::kMajority);
  const auto got = testing::cells_of(testing::tiles_of(tiles));
  ASSERT_EQ(got.size(), expected.size()) << "level " << level;
  for (const auto& [cell, values] : got) {
    ASSERT_TRUE(expected.contains(cell)) << cell[0] << " " << cell[1] << " " << cell[2];
    reference::LevelMean& mean = expected[cell];
    mean.has_color = mean.has_color && grid.channels.color;
    mean.has_normal = mean.has_normal && grid.channels.normal;
    expect_mean(values, mean);
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(Level, every_level_of_random_cells_is_what_the_oracle_says) {
  for (const bool channels : {false, true}) {
    const Grid grid = testing::random_grid(7, {600, 300, 530}, 6000, channels, channels);
    for (int level = 1; level <= kLevelMax; ++level) {
      for (const LevelRule rule : {LevelRule::kAny, LevelRule::kMajority}) {
        expect_level(grid, level, rule);
      }
    }
  }
}

TEST(Level, dense_boxes_keep_their_means_by_both_rules) {
  Grid grid = testing::random_grid(8, {300, 40, 40}, 1, true, true);
  grid.tiles = test::tiles_of(test::box_voxels({243, 3, 5}, {293, 22, 31}), true, true);
  normalize_tiles(grid);
  for (const int level : {1, 2, 3, 4, 5, 9}) {
    for (const LevelRule rule : {LevelRule::kAny, LevelRule::kMajority}) {
      expect_level(grid, level, rule);
    }
  }
}

TEST(Level, full_nodes_become_full_nodes) {
  for (const bool channels : {false, true}) {
    const Grid grid = testing::grid_with_full_nodes(9, 3, channels, channels);
    for (const int level : {1, 2, 3, 4, 6}) {
      expect_level(grid, level, LevelRule::kAny);
      expect_level(grid, level, LevelRule::kMajority);
    }
  }
  Grid full;
  full.spec.dims = {1024, 512, 512};
  full.channels.color = true;
  for (int i = 0; i < 16; ++i) {
    SparseTile tile;
    tile.coord = {i % 4, i / 4 % 2, i / 8};
    tile.full = {{0, kTileLevels}};
    full.tiles.push_back(tile);
  }
  normalize_tiles(full);
  const GridTiles source(full);
  const auto tiles = testing::tiles_of(LevelTiles(source, 1, LevelRule::kMajority));
  ASSERT_EQ(tiles.size(), 2u);
  EXPECT_EQ(tiles[0].full, (std::vector<FullNode>{{0, kTileLevels}}));
}

TEST(Level, voxels_of_full_nodes_count_as_covered) {
  Grid grid;
  grid.spec.dims = {16, 16, 16};
  grid.channels.coverage = true;
  grid.meta = GridMeta::parse(R"({"options":{"fill":"solid"}})");
  SparseTile tile;
  tile.full = {{0, 0}};
  tile.brick_morton = {1};
  BrickMask all;
  all.words.fill(~uint64_t{0});
  tile.masks = {all};
  tile.coverage.assign(512, 51);
  grid.tiles.push_back(tile);
  const GridTiles source(grid);
  const auto halves = testing::tiles_of(LevelTiles(source, 1, LevelRule::kAny));
  ASSERT_EQ(halves.size(), 1u);
  EXPECT_EQ(halves[0].coverage.size(), halves[0].attribute_count());
  EXPECT_EQ(std::ranges::count(halves[0].coverage, 51), 64);
  EXPECT_EQ(std::ranges::count(halves[0].coverage, 255),
            static_cast<ptrdiff_t>(halves[0].attribute_count()) - 64);
  EXPECT_EQ(halves[0].voxel_count(), 128u);
  const auto one = testing::tiles_of(LevelTiles(source, 4, LevelRule::kAny));
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].coverage, std::vector<uint8_t>{38}) << "two bricks of eight, 255 and 51";
  // Of a surface by the cells of a face.
  grid.meta = {};
  const GridTiles surface(grid);
  EXPECT_EQ(std::ranges::count(
                testing::tiles_of(LevelTiles(surface, 1, LevelRule::kAny))[0].coverage, 2 * 51),
            64);
}

TEST(Level, a_cube_that_is_half_full_is_occupied_by_majority) {
  Grid grid = testing::random_grid(1, {4, 4, 4}, 1, false, false);
  // Four of the eight cells of one cube, three of another.
  std::vector<test::TestVoxel> voxels;
  for (const Cell& cell :
       {Cell{0, 0, 0}, {1, 0, 0}, {0, 1, 1}, {1, 1, 1}, {2, 0, 0}, {3, 0, 0}, {2, 1, 1}}) {
    voxels.push_back({cell, {}, {}});
  }
  grid.tiles = test::tiles_of(voxels, false, false);
  const GridTiles source(grid);
  const auto cells =
      testing::cells_of(testing::tiles_of(LevelTiles(source, 1, LevelRule::kMajority)));
  EXPECT_EQ(cells.size(), 1u);
  EXPECT_TRUE(cells.contains({0, 0, 0}));
}

TEST(Level, majority_counts_cells_of_level_0_and_not_levels_of_levels) {
  // Each of four cubes of 2 cells has its half, so by levels the cube of 4 cells would be occupied;
  // but it has 16 of 64.
  Grid grid = testing::random_grid(1, {4, 4, 4}, 1, false, false);
  std::vector<test::TestVoxel> voxels;
  for (int cube = 0; cube < 4; ++cube) {
    for (int i = 0; i < 4; ++i) {
      voxels.push_back({{cube % 2 * 2 + i % 2, cube / 2 * 2 + i / 2, 0}, {}, {}});
    }
  }
  grid.tiles = test::tiles_of(voxels, false, false);
  const GridTiles source(grid);
  const LevelTiles once(source, 1, LevelRule::kMajority);
  EXPECT_EQ(testing::cells_of(testing::tiles_of(once)).size(), 4u);
  EXPECT_EQ(testing::cells_of(testing::tiles_of(LevelTiles(once, 1, LevelRule::kMajority))).size(),
            1u);
  EXPECT_TRUE(testing::tiles_of(LevelTiles(source, 2, LevelRule::kMajority)).empty());
}

TEST(Level, occupancy_by_any_does_not_depend_on_the_levels_between) {
  const Grid grid = testing::random_grid(3, {700, 300, 300}, 4000, false, false);
  const GridTiles source(grid);
  const LevelTiles two(source, 2, LevelRule::kAny), again(two, 3, LevelRule::kAny);
  EXPECT_EQ(testing::tiles_of(again), testing::tiles_of(LevelTiles(source, 5, LevelRule::kAny)));
}

TEST(Level, place_and_size) {
  GridSpec spec;
  spec.dims = {5, 8, 16384};
  spec.origin_world = {1, 2, 3};
  spec.voxel_size = {0.1, 0.2, 0.3};
  const GridSpec two = level_spec(spec, 2);
  EXPECT_EQ(two.dims, glm::ivec3(2, 2, 4096));
  EXPECT_EQ(two.origin_world, spec.origin_world);
  EXPECT_EQ(two.voxel_size, spec.voxel_size * 4.0);
  EXPECT_EQ(level_spec(spec, 14).dims, glm::ivec3(1));
}

// A tile has up to 2^24 voxels with attributes; a level of one is made of one brick after another.
TEST(Level, has_a_cancellation_point_for_each_brick_and_some_cells) {
  Grid grid = testing::random_grid(1, {40, 40, 40}, 1, true, true);
  grid.tiles = test::tiles_of(test::box_voxels({0, 0, 0}, {40, 40, 40}), true, true);
  const GridTiles source(grid);
  const auto points_of = [&](int level) {
    const LevelTiles tiles(source, level, LevelRule::kAny);
    return test::points_passed([&] { EXPECT_TRUE(tiles.tile(0).ok()); });
  };
  EXPECT_GE(points_of(9), 125);
  EXPECT_GE(points_of(1), 125 + 2);  // and of 8000 voxels
}

TEST(Level, a_mean_distance_is_never_zero) {
  const auto mean_of = [](int16_t a, int16_t b) {
    Grid grid;
    grid.spec.dims = {2, 2, 2};
    grid.channels.distance = true;
    grid.tiles = test::tiles_of(
        {{.cell = {0, 0, 0}, .distance = a}, {.cell = {1, 0, 0}, .distance = b}}, grid.channels);
    const GridTiles source(grid);
    return testing::tiles_of(LevelTiles(source, 1, LevelRule::kAny))[0].distance[0];
  };
  EXPECT_EQ(mean_of(-1, -1), -1);
  EXPECT_EQ(mean_of(-128, 127), -1);
  EXPECT_EQ(mean_of(-128, 128), 1);
  EXPECT_EQ(mean_of(-40, -20), -15);
}

TEST(Level, colours_are_mixed_in_linear_light) {
  Grid grid = testing::random_grid(1, {2, 2, 2}, 1, true, false);
  grid.tiles = test::tiles_of({{{0, 0, 0}, {255, 0, 0, 255}, {}}, {{1, 0, 0}, {0, 0, 0, 255}, {}}},
                              true, false);
  const GridTiles source(grid);
  const auto cells = testing::cells_of(testing::tiles_of(LevelTiles(source, 1, LevelRule::kAny)));
  ASSERT_EQ(cells.size(), 1u);
  EXPECT_EQ(cells.begin()->second.color, (std::array<int, 4>{188, 0, 0, 255}));
}

}  // namespace
}  // namespace voxeld
