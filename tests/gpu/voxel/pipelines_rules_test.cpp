// Rules thin and center: the same bytes from all pipelines, and what the definitions promise.
// tests/gpu/oracle compares their cells with the oracle.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/long_form.h"

namespace voxeld::pipelines {
namespace {

constexpr std::array<std::pair<Rule, const char*>, 2> kRules = {
    {{Rule::kThin, "thin"}, {Rule::kCenter, "center"}}};

VoxelizeOptions with_rule(VoxelizeOptions options, Rule rule) {
  options.rule = rule;
  options.channels = ChannelSet{.color = true, .normal = true};
  return options;
}

TEST(Rules, voxels_have_the_colours_and_normals_that_they_have_under_touch) {
  const Scene scene = soup(41, {.count = 3000, .extent = 64, .size_max = 24, .colors = true});
  const VoxelizeOptions options = unit_cells({64, 64, 64});
  const Cells touched = cells_of(voxelize_all(scene, with_rule(options, Rule::kTouch)));
  Cells thin;
  for (const auto& [rule, name] : kRules) {
    const Cells cells = cells_of(voxelize_all(scene, with_rule(options, rule), name));
    EXPECT_GT(cells.size(), 10'000u) << name;
    EXPECT_LT(cells.size(), touched.size()) << name;
    for (const auto& [cell, voxel] : cells) {
      const auto it = touched.find(cell);
      ASSERT_TRUE(it != touched.end() && it->second == voxel)
          << name << " " << cell[0] << " " << cell[1] << " " << cell[2];
      ASSERT_TRUE(rule == Rule::kThin || thin.contains(cell));
    }
    if (rule == Rule::kThin) thin = cells;
  }
}

TEST(Rules, give_the_same_bytes_across_tiles) {
  const Scene scene = soup(42, {.count = 700, .extent = 600, .size_max = 300, .colors = true});
  for (const auto& [rule, name] : kRules) {
    if (rule == Rule::kThin && !long_form()) continue;  // the next test crosses tiles by both
    const Grid grid = voxelize_all(scene, with_rule(unit_cells({600, 600, 600}), rule), name);
    EXPECT_GT(voxel_count(grid), 500'000u) << name;
  }
}

TEST(Rules, give_the_same_bytes_for_giant_triangles_at_1024) {
  const Scene scene = soup(43, {.count = 100, .extent = 1024, .size_max = 1024});
  VoxelizeOptions options = unit_cells({1024, 1024, 1024});
  options.color = ColorMode::kNone;
  for (const auto& [rule, name] : kRules) {
    options.rule = rule;
    EXPECT_GT(voxel_count(voxelize_all(scene, options, name)), 500'000u) << name;
  }
}

TEST(Rules, do_not_depend_on_the_order_of_triangles_or_corners) {
  const Scene scene = soup(44, {.count = 1500, .extent = 48, .size_max = 16, .colors = true});
  std::vector<size_t> order(1500);
  std::iota(order.begin(), order.end(), 0u);
  std::mt19937_64 random(1);
  for (const auto& [rule, name] : kRules) {
    VoxelizeOptions options = unit_cells({48, 48, 48});
    options.rule = rule;
    const Grid expected = voxelize_all(scene, options, name);
    for (const size_t turn : by_form<size_t>({1, 2}, {0, 1, 2})) {
      std::shuffle(order.begin(), order.end(), random);
      MeshPart part = scene.parts[0];
      for (size_t t = 0; t < order.size(); ++t) {
        for (size_t i = 0; i < 3; ++i) {
          const size_t corner = turn == 1 ? (3 - i) % 3 : (turn + i) % 3;
          part.indices[3 * order[t] + i] = scene.parts[0].indices[3 * t + corner];
        }
      }
      const Grid grid = voxelize_all(scene_of(std::move(part)), options, name);
      EXPECT_TRUE(grid.tiles == expected.tiles) << name << " turn " << turn;
    }
  }
}

TEST(Rules, a_translation_by_whole_voxels_shifts_the_grid) {
  Scene scene = soup(45, {.count = 500, .extent = 150, .size_max = 50, .colors = true});
  const glm::ivec3 shift(201, 77, 110);
  Scene moved = scene;
  for (glm::dvec3& p : moved.parts[0].positions) p += glm::dvec3(shift);
  for (const auto& [rule, name] : kRules) {
    const VoxelizeOptions options = with_rule(unit_cells({360, 300, 300}), rule);
    const Cells before = cells_of(voxelize_all(scene, options, name));
    Cells expected;
    for (const auto& [cell, voxel] : before) {
      expected[{cell[0] + shift.x, cell[1] + shift.y, cell[2] + shift.z}] = voxel;
    }
    EXPECT_EQ(cells_of(voxelize_all(moved, options, name)), expected) << name;
  }
}

TEST(Rules, a_box_is_one_layer_thick) {
  MeshPart part;
  add_box(part, {0, 0, 0}, {16, 16, 16});
  for (const auto& [rule, name] : kRules) {
    VoxelizeOptions options = unit_cells({16, 16, 16});
    options.rule = rule;
    const Cells cells = cells_of(voxelize_all(scene_of(part), options, name));
    EXPECT_EQ(cells.size(), 16u * 16 * 16 - 14 * 14 * 14) << name;
  }
}

TEST(Rules, none_gives_an_empty_surface) {
  VoxelizeOptions options = with_rule(unit_cells({48, 48, 48}), Rule::kNone);
  const Scene scene = soup(46, {.count = 300, .extent = 48, .size_max = 16, .colors = true});
  EXPECT_TRUE(voxelize_all(scene, options).tiles.empty());
}

}  // namespace
}  // namespace voxeld::pipelines
