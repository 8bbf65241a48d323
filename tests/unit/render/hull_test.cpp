// Hulls against all corners of all voxels.
#include "server/render/hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>

#include "proto/limits.h"
#include "tests/unit/base/points_passed.h"

namespace voxeld {
namespace {

glm::ivec3 cell_of(const SparseTile& tile, uint32_t brick_morton, uint32_t bit) {
  const auto brick = morton_decode(brick_morton), p = morton_decode(bit);
  const glm::ivec3 base(tile.coord[0], tile.coord[1], tile.coord[2]);
  return base * limits::kTileSide + glm::ivec3(brick[0], brick[1], brick[2]) * limits::kBrickSide +
         glm::ivec3(p[0], p[1], p[2]);
}

// The corners of all cells.
std::vector<glm::ivec3> all_corners(const Grid& grid) {
  std::vector<glm::ivec3> corners;
  const auto add = [&](const glm::ivec3& low, int side) {
    for (int i = 0; i < 8; ++i) {
      corners.push_back(low + side * glm::ivec3(i & 1, i >> 1 & 1, i >> 2));
    }
  };
  for (const SparseTile& tile : grid.tiles) {
    for (const FullNode& node : tile.full) {
      add(cell_of(tile, node.brick_morton, 0), limits::kBrickSide << node.level);
    }
    for (size_t brick = 0; brick < tile.masks.size(); ++brick) {
      for (uint32_t bit = 0; bit < 512; ++bit) {
        if ((tile.masks[brick].words[bit / 64] >> (bit % 64) & 1) == 0) continue;
        add(cell_of(tile, tile.brick_morton[brick], bit), 1);
      }
    }
  }
  return corners;
}

double furthest(const std::vector<glm::ivec3>& points, const glm::dvec3& direction) {
  double most = -std::numeric_limits<double>::infinity();
  for (const glm::ivec3& p : points) most = std::max(most, glm::dot(glm::dvec3(p), direction));
  return most;
}

uint32_t below(uint32_t limit, std::mt19937& random) {
  return static_cast<uint32_t>(random()) % limit;
}

// A few tiles with bricks of a few voxels, and perhaps a full node.
Grid random_grid(const glm::ivec3& dims, std::mt19937& random) {
  Grid grid;
  grid.spec.dims = dims;
  const glm::ivec3 tiles = grid.spec.tile_dims();
  for (int z = 0; z < tiles.z; ++z) {
    SparseTile tile;
    tile.coord = {static_cast<int>(below(static_cast<uint32_t>(tiles.x), random)),
                  static_cast<int>(below(static_cast<uint32_t>(tiles.y), random)), z};
    if (below(2, random) == 0) tile.full = {{64 * 3, 1 + below(2, random)}};
    for (uint32_t brick = 1000; brick < 4096; brick += 1 + below(700, random)) {
      BrickMask mask;
      for (int i = 0; i < 6; ++i) mask.words[below(8, random)] |= uint64_t{1} << below(64, random);
      tile.brick_morton.push_back(brick);
      tile.masks.push_back(mask);
    }
    grid.tiles.push_back(std::move(tile));
  }
  return grid;
}

void expect_hull(const Grid& grid, double slack, std::mt19937& random) {
  const std::vector<glm::ivec3> all = all_corners(grid), hull = hull_points(grid);
  ASSERT_FALSE(hull.empty());
  EXPECT_LT(hull.size(), all.size());
  std::normal_distribution<double> normal;
  for (int i = 0; i < 500; ++i) {
    glm::dvec3 direction(normal(random), normal(random), normal(random));
    if (i < 3) direction = glm::dvec3(i == 0, i == 1, i == 2);
    direction = glm::normalize(i % 2 == 0 ? direction : -direction);
    const double wanted = furthest(all, direction), got = furthest(hull, direction);
    EXPECT_GE(got, wanted - 1e-9);
    EXPECT_LE(got, wanted + slack + 1e-9);
  }
}

TEST(Hull, has_the_corners_of_all_voxels_inside_and_touches_them) {
  std::mt19937 random(11);
  for (const glm::ivec3& dims : {glm::ivec3(256), glm::ivec3(512, 256, 1024)}) {
    for (int round = 0; round < 4; ++round) expect_hull(random_grid(dims, random), 0.0, random);
  }
}

TEST(Hull, is_larger_by_less_than_two_cubes_where_cells_are_joined) {
  std::mt19937 random(12);
  // Cubes of 2, 4 and 16 cells: below, and above the side of a brick.
  for (const int side : {2048, 4096, 16384}) {
    const double cube = side / 1024.0;
    expect_hull(random_grid(glm::ivec3(side, 512, side), random), 2 * cube * std::sqrt(3.0),
                random);
  }
}

TEST(Hull, of_one_voxel_is_a_cube_and_of_none_is_empty) {
  Grid grid;
  grid.spec.dims = {20, 20, 20};
  EXPECT_TRUE(hull_points(grid).empty());
  SparseTile tile;
  tile.brick_morton = {0};
  tile.masks.emplace_back();
  tile.masks[0].words[0] = 1;
  grid.tiles = {tile};
  const std::vector<glm::ivec3> hull = hull_points(grid);
  EXPECT_EQ(hull.size(), 8u);
  EXPECT_EQ(furthest(hull, {1, 1, 1}), 3.0);
  EXPECT_EQ(furthest(hull, {-1, -1, -1}), 0.0);
}

TEST(Hull, sorting_can_be_cancelled) {
  Grid grid;
  grid.spec.dims = glm::ivec3(64);
  SparseTile tile;
  tile.full = {{0, 3}};
  grid.tiles = {tile};
  // One for the node, and one for each comparison of the 64 slices' corners.
  EXPECT_GE(test::points_passed([&] { (void)hull_points(grid); }), 512);
}

}  // namespace
}  // namespace voxeld
