// interior=nearest against the oracle, voxel for voxel.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "server/voxel/solid/distance/nearest_cells.h"
#include "tests/bench/waves.h"
#include "tests/reference/distance_oracle.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

// `count` cells anywhere in a grid.
struct Cells {
  Cells(const glm::ivec3& dims, int count, unsigned seed)
      : oracle{{dims.x, dims.y, dims.z}, {}, {}} {
    set.resize(static_cast<size_t>(dims.x) * static_cast<size_t>(dims.y) *
               static_cast<size_t>(dims.z));
    std::map<std::array<int, 3>, std::map<uint32_t, BrickMask>> bricks;
    std::mt19937 random(seed);
    for (int i = 0; i < count; ++i) {
      const glm::ivec3 cell(random() % static_cast<unsigned>(dims.x),
                            random() % static_cast<unsigned>(dims.y),
                            random() % static_cast<unsigned>(dims.z));
      set[static_cast<size_t>(cell.x) +
          static_cast<size_t>(dims.x) *
              (static_cast<size_t>(cell.y) +
               static_cast<size_t>(dims.y) * static_cast<size_t>(cell.z))] = 1;
      const glm::uvec3 at(cell & 255);
      BrickMask& mask = bricks[{cell.z / 256, cell.y / 256, cell.x / 256}]
                              [morton_encode(at.x / 8, at.y / 8, at.z / 8)];
      const uint32_t bit = morton_encode(at.x & 7, at.y & 7, at.z & 7);
      mask.words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
    for (const auto& [coord, masks] : bricks) {
      SparseTile& tile = tiles.emplace_back();
      tile.coord = {coord[2], coord[1], coord[0]};
      for (const auto& [morton, mask] : masks) {
        tile.brick_morton.push_back(morton);
        tile.masks.push_back(mask);
      }
    }
  }
  OracleGrid oracle;
  Occupancy set;
  std::vector<SparseTile> tiles;
};

TEST(NearestCells, every_cell_has_the_nearest_and_the_lowest_of_equally_near_ones) {
  const struct {
    glm::ivec3 dims;
    int count;
  } cases[] = {{{17, 23, 9}, 1}, {{17, 23, 9}, 6}, {{32, 8, 30}, 40}, {{9, 9, 9}, 200},
               {{1, 40, 1}, 3},  {{300, 3, 5}, 9}, {{4, 270, 6}, 12}, {{5, 2, 600}, 10}};
  for (const auto& [dims, count] : cases) {
    const Cells cells(dims, count, static_cast<unsigned>(count));
    const BrickIndex index(cells.tiles, dims);
    ThreadTeam team(2);
    NearestCells nearest(index, dims, team);
    for (int x = 0; x < dims.x; ++x) {
      if (x % NearestCells::kWidth == 0) {
        ASSERT_TRUE(nearest.compute(x / NearestCells::kWidth));
      }
      for (int z = 0; z < dims.z; ++z) {
        for (int y = 0; y < dims.y; ++y) {
          const auto expected = reference::nearest_cell(cells.set, cells.oracle, {x, y, z});
          const glm::ivec3 got = nearest.nearest({x, y, z});
          ASSERT_TRUE(expected);
          ASSERT_EQ(*expected, (std::array<int, 3>{got.x, got.y, got.z}))
              << x << " " << y << " " << z << " of " << dims.x << " " << dims.y << " " << dims.z;
        }
      }
    }
  }
}

TEST(NearestCells, in_an_empty_grid_there_is_none) {
  const BrickIndex index({}, {20, 20, 20});
  ThreadTeam team(1);
  EXPECT_FALSE(NearestCells(index, {20, 20, 20}, team).compute(0));
}

struct Attributes {
  std::array<uint8_t, 4> color{};
  std::array<int8_t, 3> normal{};
  bool operator==(const Attributes&) const = default;
};

std::map<std::array<int, 3>, Attributes> attributes_of(const Grid& grid) {
  std::map<std::array<int, 3>, Attributes> all;
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t i) {
      Attributes& one = all[{x, y, z}];
      ASSERT_NE(i, kNoAttributes);
      for (size_t c = 0; c < 4; ++c) one.color[c] = tile.color[4 * i + c];
      for (size_t c = 0; c < 3; ++c) one.normal[c] = tile.normal[3 * i + c];
    });
  }
  return all;
}

VoxelizeOptions with_attributes(Fill fill, int size) {
  VoxelizeOptions options;
  options.placement.size = size;
  options.fill = fill;
  options.color = ColorMode::kAxis;
  options.channels = ChannelSet{.color = true, .normal = true};
  options.interior = Interior::kNearest;
  return options;
}

TEST(Interior, voxels_inside_have_the_attributes_of_the_nearest_surface_voxel) {
  const Scene scene = wavy_sphere(2);
  for (const Rule rule : {Rule::kTouch, Rule::kCenter}) {
    for (const Fill fill : {Fill::kSolid, Fill::kShell}) {
      VoxelizeOptions options = with_attributes(fill, 33);
      options.rule = rule;
      options.thickness = 4;
      const Grid filled = voxelized(scene, options);
      options.interior = Interior::kNone;
      EXPECT_EQ(differences(cells_of(filled), cells_of(voxelized(scene, options))), 0u);
      options.fill = Fill::kSurface;
      const Grid surface = voxelized(scene, options);
      const Occupancy cells = cells_of(surface);
      const auto of_surface = attributes_of(surface), of_filled = attributes_of(filled);
      EXPECT_GT(of_filled.size(), of_surface.size() + 1000);
      for (const auto& [cell, got] : of_filled) {
        const auto nearest = reference::nearest_cell(cells, oracle_grid(surface), cell);
        ASSERT_TRUE(got == of_surface.at(*nearest)) << cell[0] << " " << cell[1] << " " << cell[2];
      }
    }
  }
}

TEST(Interior, threads_and_tiles_do_not_matter) {
  const Scene scene = wavy_sphere(3);
  VoxelizeOptions options = with_attributes(Fill::kSolid, 258);
  const Grid one = voxelized(scene, options, nullptr, 1),
             three = voxelized(scene, options, nullptr, 3);
  EXPECT_TRUE(one.tiles == three.tiles);
  EXPECT_GT(one.tiles.size(), 1u);
  for (const SparseTile& tile : one.tiles) EXPECT_TRUE(tile.full.empty());
}

TEST(Interior, without_attributes_the_inside_stays_full_nodes) {
  VoxelizeOptions options = with_attributes(Fill::kSolid, 100);
  options.color = ColorMode::kNone;
  options.channels->color = options.channels->normal = false;
  const Grid grid = voxelized(wavy_sphere(2), options);
  EXPECT_FALSE(grid.tiles.front().full.empty());
}

TEST(Interior, a_solid_that_needs_too_much_memory_is_refused_with_numbers) {
  const Scene scene = box(glm::dvec3(0), glm::dvec3(1));
  Voxelizer voxelizer(nullptr, 2);
  VoxelizeOptions options = with_attributes(Fill::kSolid, 300);
  options.interior = Interior::kNone;
  const auto estimate = voxelizer.estimate(scene, options);
  ASSERT_TRUE(estimate.ok());
  voxelizer.set_host_bytes_max(estimate->host_bytes);
  ASSERT_TRUE(voxelizer.voxelize(scene, options, {}, nullptr).ok());
  options.interior = Interior::kNearest;
  const auto refused = voxelizer.voxelize(scene, options, {}, nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_NE(refused.error().got.find("an estimate of"), std::string::npos);
}

}  // namespace
}  // namespace voxeld
