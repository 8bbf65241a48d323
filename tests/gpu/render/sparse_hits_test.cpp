// The ray march through what the tree of tables skips: empty tiles, blocks and bricks, full nodes,
// and grids far larger than what they hold.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "server/render/camera.h"
#include "tests/gpu/render/hits_check.h"
#include "tests/gpu/render/test_grids.h"

namespace voxeld {
namespace {

uint32_t below(uint32_t end, std::mt19937& random) {
  return static_cast<uint32_t>(random() % end);
}

// A tile with bricks of noise, `gap` / 2 apart, and full nodes of `full_level`, which may be -1.
SparseTile scattered_tile(const glm::ivec3& coord, int full_level, uint32_t gap,
                          std::mt19937& random) {
  SparseTile tile;
  tile.coord = {coord.x, coord.y, coord.z};
  uint32_t free_from = 0;
  if (full_level >= 0) {
    FullNode node{0, static_cast<uint32_t>(full_level)};
    const uint32_t places = (1u << (3 * kTileLevels)) / node.brick_count();
    node.brick_morton = below(places, random) * node.brick_count();
    tile.full = {node};
    free_from = node.brick_morton + node.brick_count();
  }
  constexpr uint32_t kBricks = 1u << (3 * kTileLevels);
  for (uint32_t brick = free_from + below(97, random); brick < kBricks;
       brick += 1 + below(gap, random)) {
    tile.brick_morton.push_back(brick);
    BrickMask& mask = tile.masks.emplace_back();
    for (uint64_t& word : mask.words) {
      word = (uint64_t{random()} << 32 | random()) & (uint64_t{random()} << 32 | random());
    }
    mask.words[0] |= 1;
  }
  return tile;
}

// Tiles near the plane x + y + z = side / 2, so that rays pass many empty ones.
// One tile in `every`, with full nodes of levels below `full_levels`.
Grid scattered_grid(int tiles_per_side, uint32_t every, int full_levels, uint32_t gap,
                    uint32_t seed) {
  Grid grid;
  grid.spec = spec_of(glm::ivec3(256 * tiles_per_side), glm::dvec3(1.0));
  std::mt19937 random(seed);
  const int middle = 3 * (tiles_per_side - 1) / 2;
  for (int z = 0; z < tiles_per_side; ++z) {
    for (int y = 0; y < tiles_per_side; ++y) {
      const int x = middle - y - z;
      if (x < 0 || x >= tiles_per_side || below(every, random) != 0) continue;
      const int full_level =
          full_levels - 1 - static_cast<int>(below(static_cast<uint32_t>(full_levels) + 1, random));
      grid.tiles.push_back(scattered_tile({x, y, z}, full_level, gap, random));
    }
  }
  return grid;
}

TEST(SparseRayMarch, hits_the_same_through_several_tiles_of_which_many_are_empty) {
  const Grid grid = scattered_grid(5, 1, 5, 50, 31);
  ASSERT_GT(grid.tiles.size(), 10u);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  int hits = 0;
  for (const auto& [azimuth, elevation, zoom] :
       {std::tuple{30.0, 20.0, 1.0}, {200.0, -40.0, 4.0}, {100.0, 80.0, 30.0}, {45.0, 35.0, 1.5}}) {
    RenderOptions options = options_of(60, 60, azimuth, elevation);
    options.zoom = zoom;
    hits += expect_same_hits(options, grid, 2 * kEdge);
  }
  EXPECT_GT(hits, 3000);
}

TEST(SparseRayMarch, hits_the_same_along_axes_and_cell_boundaries) {
  const Grid grid = scattered_grid(3, 1, 5, 50, 5);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  for (const auto& [azimuth, elevation] :
       {std::pair{0.0, 0.0}, {90.0, 0.0}, {180.0, 0.0}, {270.0, 0.0}, {0.0, 90.0}, {0.0, -90.0}}) {
    RenderOptions options = options_of(64, 64, azimuth, elevation);
    options.projection = Projection::kOrthographic;
    options.zoom = 0.937;  // no ray runs in a plane between cells
    EXPECT_GT(expect_same_hits(options, grid), 400);
  }
  // One pixel is 12 cells, from 0 on: every ray runs in two planes between cells, tiles among them.
  RenderOptions options = options_of(64, 64, 0, 0);
  const glm::dvec3 o = grid.spec.origin_world;
  const double s = 2.0 / 768;
  const double shift = s * 6.0;  // from the middles of pixels to their corners
  options.matrix = {s, 0, 0,  -1 - s * o.x + shift, 0, s, 0, -1 - s * o.y + shift,
                    0, 0, -s, 1 + s * o.z,          0, 0, 0, 1};
  const auto hits = hits_renderer().render_hits(options);
  ASSERT_TRUE(hits.ok()) << hits.error().message();
  int hit_count = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Hit& hit = (*hits)[static_cast<size_t>(y * 64 + x)];
      if (hit.face < 0) continue;
      ++hit_count;
      // A ray in a plane between cells belongs to the cell above it.
      EXPECT_EQ(hit.cell.x, 12 * x);
      EXPECT_EQ(hit.cell.y, 12 * (63 - y));
      EXPECT_EQ(hit.face, 5);
    }
  }
  EXPECT_GT(hit_count, 400);
}

TEST(SparseRayMarch, rays_that_begin_inside_full_nodes_or_at_their_cut_face_hit_at_once) {
  Grid grid;
  grid.spec = spec_of(glm::ivec3(512, 256, 256), glm::dvec3(1.0));
  SparseTile solid;
  solid.full = {{0, kTileLevels}};
  std::mt19937 random(3);
  grid.tiles = {solid, scattered_tile({1, 0, 0}, 4, 300, random)};
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  RenderOptions options = options_of(48, 48, 40, 25);
  const glm::dvec3 middle = grid.spec.world_from_grid({100.5, 100.25, 90.75});
  options.section = {1, 2, 3, -glm::dot(glm::dvec3(1, 2, 3), middle)};
  EXPECT_GT(expect_same_hits(options, grid), 200);
  options.section.reset();
  options.matrix = row_major(glm::perspective(1.2, 1.0, 0.1, 2000.0) *
                             glm::lookAt(middle, middle + glm::dvec3(1, 0.2, 0.1), {0, 1, 0}));
  EXPECT_EQ(expect_same_hits(options, grid), 48 * 48);
  const auto hits = hits_renderer().render_hits(options);
  ASSERT_TRUE(hits.ok());
  EXPECT_EQ((*hits)[24 * 48 + 24].cell, glm::ivec3(100, 100, 90));
  const auto image = hits_renderer().render(options, {});
  ASSERT_TRUE(image.ok());
  EXPECT_EQ(image->rgba[3], 255);
}

TEST(SparseRayMarch, hits_the_same_in_a_grid_of_16384_cells_a_side) {
  const Grid grid = scattered_grid(64, 1, 6, 5000, 16384);
  ASSERT_EQ(grid.spec.dims, glm::ivec3(16384));
  ASSERT_GT(grid.tiles.size(), 500u);
  ASSERT_TRUE(hits_renderer().set_grid(grid).ok());
  // A ray starts exactly and is off by 2^-24 of the way after it: 2e-3 cells after 16384.
  constexpr double kFarEdge = 4e-3;
  const OracleGrid oracle(grid);
  int hits = 0;
  for (const auto& [azimuth, elevation, zoom] : {std::tuple{33.0, 21.0, 1.0},
                                                 {210.0, -35.0, 20.0},
                                                 {45.0, 35.0, 400.0},
                                                 {290.0, 60.0, 1000.0}}) {
    RenderOptions options = options_of(30, 30, azimuth, elevation);
    options.zoom = zoom;
    SCOPED_TRACE("zoom " + std::to_string(zoom));
    hits += expect_same_hits(options, grid, oracle, kFarEdge);
  }
  EXPECT_GT(hits, 120);
}

}  // namespace
}  // namespace voxeld
