// Channel coverage of solids: the part of a voxel's volume that is inside.
#include <gtest/gtest.h>

#include <bit>
#include <map>

#include "server/voxel/solid/coverage.h"
#include "tests/bench/waves.h"
#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

VoxelizeOptions covering(Sign sign, Rule rule, int size) {
  VoxelizeOptions options = solid(sign);
  options.rule = rule;
  options.placement.size = size;
  options.channels = ChannelSet{.coverage = true};
  return options;
}

// Coverage by cell; -1 where there is no voxel.
std::vector<int> coverage_of(const Grid& grid) {
  const glm::ivec3 dims = grid.spec.dims;
  std::vector<int> cells(
      static_cast<size_t>(dims.x) * static_cast<size_t>(dims.y) * static_cast<size_t>(dims.z), -1);
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const auto at =
          static_cast<size_t>(x) +
          static_cast<size_t>(dims.x) *
              (static_cast<size_t>(y) + static_cast<size_t>(dims.y) * static_cast<size_t>(z));
      cells.at(at) = voxel == kNoAttributes ? 255 : tile.coverage.at(voxel);
    });
  }
  return cells;
}

// The same by the oracle: every centre of the 4x4x4 parts of every cell against every triangle.
std::vector<int> expected_of(const Scene& scene, const Grid& grid, Sign sign) {
  OracleGrid place = oracle_grid(grid);
  auto snapped = reference::snap_triangles(triangles_of(scene), place);
  for (auto& triangle : snapped) {
    for (auto& corner : triangle) {
      for (int64_t& c : corner) c *= 4;
    }
  }
  OracleGrid finer = place;
  for (int& dim : finer.dims) dim *= 4;
  const Occupancy parts = sign == Sign::kParity     ? reference::parity_cells(snapped, finer, 2)
                          : sign == Sign::kMajority ? reference::majority_cells(snapped, finer)
                                                    : reference::nonzero_cells(snapped, finer);
  const auto dim = [&](size_t axis) { return static_cast<size_t>(place.dims[axis]); };
  std::vector<int> sums(dim(0) * dim(1) * dim(2));
  for (size_t i = 0; i < parts.size(); ++i) {
    const size_t x = i % (4 * dim(0)), y = i / (4 * dim(0)) % (4 * dim(1)),
                 z = i / (16 * dim(0) * dim(1));
    sums[x / 4 + dim(0) * (y / 4 + dim(1) * (z / 4))] += parts[i];
  }
  for (int& sum : sums) sum = (255 * sum + 32) / 64;
  return sums;
}

void expect_equal(const Grid& grid, const std::vector<int>& expected,
                  const VoxelizeOptions& options) {
  const std::vector<int> got = coverage_of(grid);
  ASSERT_EQ(got.size(), expected.size());
  std::map<int, int> kinds;  // of what was compared
  size_t wrong = 0;
  for (size_t i = 0; i < got.size(); ++i) {
    if (got[i] < 0) continue;
    wrong += got[i] == expected[i] ? 0 : 1;
    ++kinds[got[i]];
  }
  EXPECT_EQ(wrong, 0u) << "sign " << static_cast<int>(options.sign) << " rule "
                       << static_cast<int>(options.rule);
  EXPECT_GT(kinds.size(), 20u);
  EXPECT_GT(kinds[255], 50);
}

// By several rules, which choose the voxels.
void expect_oracle(const Scene& scene, Sign sign, int size, const std::vector<Rule>& rules) {
  std::vector<int> expected;  // takes longest
  for (const Rule rule : rules) {
    const VoxelizeOptions options = covering(sign, rule, size);
    const Grid grid = voxelized(scene, options);
    if (expected.empty()) expected = expected_of(scene, grid, sign);
    expect_equal(grid, expected, options);
  }
}

TEST(SolidCoverage, matches_the_oracle_in_every_voxel) {
  const Scene scene = wavy_sphere(1);
  for (const Sign sign : {Sign::kParity, Sign::kNonzero, Sign::kMajority}) {
    expect_oracle(scene, sign, 14, {Rule::kTouch, Rule::kThin, Rule::kNone});
  }
}

TEST(SolidCoverage, holds_for_triangles_that_close_nothing) {
  const Scene scene = soup(40, glm::dvec3(20, 17, 23), 7);
  for (const Sign sign : {Sign::kParity, Sign::kNonzero}) {
    expect_oracle(scene, sign, 17, {Rule::kNone, Rule::kTouch});
  }
}

TEST(SolidCoverage, is_one_inside_and_a_half_where_the_side_halves_a_voxel) {
  VoxelizeOptions options = covering(Sign::kAuto, Rule::kTouch, 0);
  set_bounds(options, glm::dvec3(0), glm::dvec3(600, 9, 9));
  const Scene scene = box(glm::dvec3(10, 2, 2), glm::dvec3(590.5, 7, 7));
  const Grid grid = voxelized(scene, options);
  const std::vector<int> cells = coverage_of(grid);
  const auto at = [&](size_t x, size_t y, size_t z) { return cells[x + 600 * (y + 9 * z)]; };
  EXPECT_EQ(at(9, 4, 4), -1);
  EXPECT_EQ(at(10, 4, 4), 255);
  EXPECT_EQ(at(300, 4, 4), 255);
  EXPECT_EQ(at(590, 4, 4), 128);
  EXPECT_EQ(at(590, 7, 4), 0) << "touched from beside";
  EXPECT_EQ(at(591, 4, 4), -1);
}

TEST(SolidCoverage, comes_with_the_attributes_of_the_surface) {
  Scene scene = wavy_sphere(2);
  VoxelizeOptions options = covering(Sign::kParity, Rule::kTouch, 40);
  const std::vector<int> alone = coverage_of(voxelized(scene, options));
  options.channels->normal = true;
  const Grid both = voxelized(scene, options);
  EXPECT_EQ(coverage_of(both), alone);
  for (const SparseTile& tile : both.tiles) EXPECT_EQ(tile.normal.size(), 3 * tile.coverage.size());
}

TEST(SolidCoverage, does_not_depend_on_the_number_of_threads) {
  const Scene scene = wavy_sphere(3);
  const VoxelizeOptions options = covering(Sign::kAuto, Rule::kTouch, 300);
  const Grid one = voxelized(scene, options, nullptr, 1);
  const Grid three = voxelized(scene, options, nullptr, 3);
  EXPECT_EQ(one.tiles, three.tiles);
  EXPECT_FALSE(one.tiles.front().coverage.empty());
}

TEST(SolidCoverage, is_refused_where_the_parts_would_be_too_many) {
  EXPECT_TRUE(check_coverage_dims({4096, 4096, 4096}).ok());
  const Status refused = check_coverage_dims({9, 4097, 9});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(refused.error().expected, "at most 4096 voxels to a side");
  EXPECT_EQ(refused.error().got, "9 x 4097 x 9");
}

}  // namespace
}  // namespace voxeld
