// Pipeline compute by words of the mask, as software drivers find occupancy by rule touch: the
// bytes of pipeline cpu. tests/gpu/oracle compares its cells with the oracle.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "server/grid/content_hash.h"
#include "server/voxel/gl/occupancy/mask_bricks.h"
#include "server/voxel/tiles/compact.h"
#include "tests/gpu/voxel/pipelines.h"
#include "tests/unit/long_form.h"

namespace voxeld::pipelines {
namespace {

Voxelizer& by_words() {
  static Voxelizer one(std::make_unique<GlPipeline>(gpu::test_context(), shared_shaders(),
                                                    GlTuning{.batches = false}));
  return one;
}

void expect_same_hash(const Scene& scene, VoxelizeOptions options, const std::string& what) {
  options.color = ColorMode::kNone;
  const Grid expected = voxelize(scene, options, PipelineChoice::kCpu);
  const Grid grid = voxelize_on(by_words(), scene, options, PipelineChoice::kCompute);
  EXPECT_GT(voxel_count(expected), 0u) << what;
  EXPECT_EQ(content_hash(grid), content_hash(expected)) << what;
}

TEST(Words, soups_in_grids_of_any_dims_give_the_same_hash) {
  uint64_t seed = 71;
  for (const std::array<int, 3> dims : {std::array{64, 64, 64},
                                        {61, 67, 65},
                                        {1, 300, 7},
                                        {259, 130, 3},
                                        {257, 258, 259},
                                        {513, 31, 255}}) {
    const Scene scene = soup(seed++, {.count = 4000, .extent = 300, .size_max = 20});
    VoxelizeOptions options;
    options.placement.dims = dims;
    options.placement.bounds = {0, 0, 0, 300, 300, 300};
    expect_same_hash(scene, options, std::to_string(dims[0]));
    expect_same_hash(scene, unit_cells(dims), std::to_string(dims[0]) + " unit cells");
  }
}

// Corners at the sides of words, bricks, blocks and tiles, and half a sub-voxel beside them.
TEST(Words, corners_around_sides_of_words_blocks_and_tiles_give_the_same_hash) {
  std::mt19937_64 random(72);
  MeshPart part;
  for (int t = 0; t < 6000; ++t) {
    const int side = std::array{2, 4, 8, 64, 256}[random() % 5];
    std::array<glm::dvec3, 3> p{};
    glm::dvec3 near(0);
    for (int c = 0; c < 3; ++c) near[c] = side * static_cast<double>(random() % (512 / side + 1));
    for (glm::dvec3& corner : p) {
      for (int c = 0; c < 3; ++c) {
        const double cells = static_cast<double>(random() % 9) - 4;
        const double beside = (static_cast<double>(random() % 5) - 2) / 512;
        corner[c] = std::clamp(near[c] + cells + beside, 0.0, 512.0);
      }
    }
    add_triangle(part, p[0], p[1], p[2]);
  }
  expect_same_hash(scene_of(std::move(part)), unit_cells({512, 512, 512}), "");
}

// 16 voxels are small, one sub-voxel more is large.
TEST(Words, boxes_around_the_largest_small_ones_give_the_same_hash) {
  std::mt19937_64 random(73);
  MeshPart part;
  for (int t = 0; t < 1500; ++t) {
    glm::dvec3 low(0);
    for (int c = 0; c < 3; ++c) low[c] = static_cast<double>(random() % (size_t{280} * 256)) / 256;
    std::array<glm::dvec3, 3> p{};
    for (glm::dvec3& corner : p) {
      for (int c = 0; c < 3; ++c) {
        const double full = 16 + (static_cast<double>(random() % 3) - 1) / 256;
        corner[c] = low[c] + (random() % 2 == 0 ? full : static_cast<double>(random() % 17));
        corner[c] = corner[c] + 1.0 / 512;
      }
    }
    add_triangle(part, p[0], p[1], p[2]);
  }
  expect_same_hash(scene_of(std::move(part)), unit_cells({300, 300, 300}), "");
}

TEST(Words, needles_and_points_across_tiles_give_the_same_hash) {
  std::mt19937_64 random(74);
  MeshPart part;
  const auto anywhere = [&] { return static_cast<double>(random() % (size_t{512} * 1024)) / 1024; };
  for (int t = 0; t < 3000; ++t) {
    const glm::dvec3 a(anywhere(), anywhere(), anywhere());
    glm::dvec3 along(0);
    for (int c = 0; c < 3; ++c) along[c] = static_cast<double>(random() % 31) - 15;
    if (t % 4 == 0) along = glm::dvec3(0);
    if (t % 4 == 1) along[t % 3] = 0;
    const glm::dvec3 b = glm::clamp(a + along, 0.0, 512.0);
    const glm::dvec3 c = a + (b - a) * 0.375 + (t % 2 == 0 ? 0.0 : 1.0 / 256);
    add_triangle(part, a, b, glm::clamp(c, 0.0, 512.0));
  }
  expect_same_hash(scene_of(std::move(part)), unit_cells({512, 512, 512}), "");
}

TEST(Words, small_and_large_triangles_together_give_the_same_hash) {
  for (const uint64_t seed : by_form<uint64_t>({75}, {75, 76})) {
    expect_same_hash(soup(seed, {.count = 3000, .extent = 600, .size_max = 200}),
                     unit_cells({600, 600, 600}), std::to_string(seed));
  }
}

TEST(Words, more_triangles_than_a_window_holds_give_the_same_hash) {
  constexpr int kCount = 20'000;
  const Scene one = soup(77, {.count = kCount, .extent = 300, .size_max = 20});
  Scene many;
  for (size_t i = 0; i < kWindowTrianglesMax / kCount + 2; ++i) many.parts.push_back(one.parts[0]);
  // Eight tiles, so that windows begin within them.
  VoxelizeOptions options = unit_cells({300, 300, 300});
  options.color = ColorMode::kNone;
  VoxelizeStats stats;
  const Grid grid = voxelize_on(by_words(), many, options, PipelineChoice::kCompute, &stats);
  EXPECT_GT(stats.triangles, static_cast<int64_t>(kWindowTrianglesMax));
  EXPECT_EQ(content_hash(grid), content_hash(voxelize(one, options, PipelineChoice::kCpu)));
}

TEST(Words, a_job_leaves_nothing_for_the_next_one_even_when_it_is_cancelled) {
  const Scene scene = soup(78, {.count = 2000, .extent = 600, .size_max = 60});
  VoxelizeOptions options = unit_cells({600, 600, 600});
  options.color = ColorMode::kNone;
  options.pipeline = PipelineChoice::kCompute;
  const auto cancelled = by_words().voxelize(
      scene, options, [](int64_t done, int64_t) { return done < 5; }, nullptr);
  ASSERT_FALSE(cancelled.ok());
  EXPECT_EQ(cancelled.error().code, ErrorCode::kCancelled);
  expect_same_hash(soup(79, {.count = 10, .extent = 600, .size_max = 9}), options,
                   "after a cancel");
}

// Three masks, of which the second is empty.
TEST(MaskBricks, are_those_of_the_masks_and_leave_them_empty) {
  std::mt19937_64 random(80);
  std::vector<BrickMask> masks(3 * kTileMaskBricks);
  std::array<uint64_t, 3> blocks{};
  for (int i = 0; i < 5000; ++i) {
    // In 17 of the blocks.
    const size_t slot = random() % 2 * 2, block = random() % 17 * 3;
    const size_t brick = block * (kTileMaskBricks / 64) + random() % (kTileMaskBricks / 64);
    masks[slot * kTileMaskBricks + brick].words[random() % 8] |= uint64_t{1} << random() % 64;
    blocks[slot] |= uint64_t{1} << block;
  }
  std::vector<uint32_t> words(kTileMaskWords);
  std::array<SparseTile, 3> expected;
  for (size_t slot = 0; slot < masks.size() / kTileMaskBricks; ++slot) {
    std::memcpy(words.data(), masks.data() + slot * kTileMaskBricks, kTileMaskBytes);
    compact_mask(words, blocks[slot], expected[slot], {});
  }
  EXPECT_TRUE(expected[1].empty());
  MaskBricks bricks;
  for (const int threads : {1, 3}) {
    ThreadTeam team(threads);
    std::vector<BrickMask> copy = masks;
    std::array<SparseTile, 3> tiles;
    bricks.take(copy, blocks, team, tiles);
    EXPECT_TRUE(tiles == expected) << threads;
    EXPECT_TRUE(std::ranges::all_of(copy, [](const BrickMask& b) { return b == BrickMask(); }));
  }
}

}  // namespace
}  // namespace voxeld::pipelines
