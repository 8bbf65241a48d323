// Both pipelines give the same bytes, for any mesh and in any order.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/long_form.h"

namespace voxeld::pipelines {
namespace {

VoxelizeOptions all_channels(VoxelizeOptions options) {
  options.channels = ChannelSet{.color = true, .normal = true};
  return options;
}

TEST(Pipelines, give_the_same_bytes_for_soups_of_awkward_triangles) {
  for (const uint64_t seed : by_form<uint64_t>({1}, {1, 2, 3, 4})) {
    const Scene scene = soup(seed, {.count = 3000, .extent = 64, .size_max = 24, .colors = true});
    const Grid grid =
        voxelize_all(scene, all_channels(unit_cells({64, 64, 64})), "seed " + std::to_string(seed));
    EXPECT_GT(voxel_count(grid), 10'000u);
  }
}

TEST(Pipelines, give_the_same_bytes_across_tiles) {
  for (const uint64_t seed : by_form<uint64_t>({5}, {5, 6})) {
    const Scene scene = soup(seed, {.count = 1500, .extent = 600, .size_max = 300, .colors = true});
    const Grid grid = voxelize_all(scene, all_channels(unit_cells({600, 600, 600})),
                                   "seed " + std::to_string(seed));
    EXPECT_EQ(grid.tiles.size(), 27u);
  }
}

TEST(Pipelines, give_the_same_bytes_for_giant_triangles_at_1024) {
  const Scene scene = soup(7, {.count = 200, .extent = 1024, .size_max = 1024});
  VoxelizeOptions options = unit_cells({1024, 1024, 1024});
  options.color = ColorMode::kAxis;
  EXPECT_GT(voxel_count(voxelize_all(scene, options)), 1'000'000u);
}

TEST(Pipelines, give_the_same_bytes_for_grids_that_are_not_cubes) {
  const Scene scene = soup(8, {.count = 1000, .extent = 64, .size_max = 20, .colors = true});
  for (const std::array<int, 3> dims :
       {std::array{1, 1, 1}, {1, 64, 9}, {300, 5, 17}, {64, 64, 1}}) {
    VoxelizeOptions options = all_channels({});
    options.placement.dims = dims;
    options.placement.bounds = {0, 0, 0, 64, 64, 64};
    EXPECT_GT(voxel_count(voxelize_all(scene, options, std::to_string(dims[0]))), 0u);
  }
}

TEST(Pipelines, give_the_same_bytes_where_bounds_cut_triangles) {
  const Scene scene = soup(9, {.count = 2000, .extent = 64, .size_max = 60, .colors = true});
  VoxelizeOptions options = all_channels(unit_cells({64, 64, 64}));
  options.placement.bounds = {20.25, 10.5, 30.125, 45.25, 50.5, 41.125};
  const Grid grid = voxelize_all(scene, options);
  EXPECT_EQ(grid.spec.dims, glm::ivec3(25, 40, 11));
  EXPECT_GT(voxel_count(grid), 1000u);
}

TEST(Pipelines, give_the_same_bytes_in_every_colour_mode) {
  const Scene scene = soup(10, {.count = 1000, .extent = 48, .size_max = 16, .colors = true});
  for (const ColorMode mode :
       {ColorMode::kAverage, ColorMode::kShaded, ColorMode::kAxis, ColorMode::kNone}) {
    VoxelizeOptions options = unit_cells({48, 48, 48});
    options.color = mode;
    const Grid grid = voxelize_all(scene, options, std::to_string(static_cast<int>(mode)));
    EXPECT_EQ(grid.channels.color, mode != ColorMode::kNone);
  }
}

// Triangle t of the scene stands at place order[t]; its corners are turned by `turn` and, if
// `flip`, taken in the other direction.
Scene reordered(const Scene& scene, const std::vector<size_t>& order, size_t turn, bool flip) {
  MeshPart part = scene.parts[0];
  for (size_t t = 0; t < order.size(); ++t) {
    for (size_t i = 0; i < 3; ++i) {
      const size_t corner = flip ? (turn + 3 - i) % 3 : (turn + i) % 3;
      part.indices[3 * order[t] + i] = scene.parts[0].indices[3 * t + corner];
    }
  }
  return scene_of(std::move(part));
}

TEST(Pipelines, do_not_depend_on_the_order_of_triangles_or_corners_or_on_winding) {
  const Scene scene = soup(11, {.count = 2000, .extent = 48, .size_max = 16, .colors = true});
  const VoxelizeOptions options = unit_cells({48, 48, 48});
  const Grid expected = voxelize_all(scene, options);
  std::vector<size_t> order(2000);
  std::iota(order.begin(), order.end(), 0u);
  std::mt19937_64 random(1);
  for (const size_t turn : by_form<size_t>({1, 2}, {0, 1, 2})) {
    std::shuffle(order.begin(), order.end(), random);
    const Grid grid = voxelize_all(reordered(scene, order, turn, turn != 1), options);
    EXPECT_TRUE(grid.tiles == expected.tiles) << "turn " << turn;
  }
}

TEST(Pipelines, a_translation_by_whole_voxels_shifts_the_grid) {
  Scene scene = soup(12, {.count = 800, .extent = 200, .size_max = 50, .colors = true});
  const VoxelizeOptions options = all_channels(unit_cells({512, 300, 512}));
  const Cells before = cells_of(voxelize_all(scene, options));
  const glm::ivec3 shift(301, 77, 160);
  for (glm::dvec3& p : scene.parts[0].positions) p += glm::dvec3(shift);
  const Cells after = cells_of(voxelize_all(scene, options));
  ASSERT_EQ(before.size(), after.size());
  // A far face at 200 stays in cell 200, which no neighbour shares, so nothing is lost by shifting.
  for (const auto& [cell, voxel] : before) {
    const auto it = after.find({cell[0] + shift.x, cell[1] + shift.y, cell[2] + shift.z});
    ASSERT_NE(it, after.end());
    ASSERT_TRUE(it->second == voxel) << cell[0] << " " << cell[1] << " " << cell[2];
  }
}

TEST(Pipelines, a_union_of_meshes_gives_the_union_of_their_cells) {
  const SoupOptions half = {.count = 500, .extent = 64, .size_max = 20};
  const Scene a = soup(13, half), b = soup(14, half);
  Scene both = a;
  both.parts.push_back(b.parts[0]);
  const VoxelizeOptions options = unit_cells({64, 64, 64});
  Cells expected = cells_of(voxelize_all(a, options));
  expected.merge(cells_of(voxelize_all(b, options)));
  EXPECT_EQ(cells_of(voxelize_all(both, options)), expected);
}

}  // namespace
}  // namespace voxeld::pipelines
