// Windows, limits, progress and cancelling.
#include <gtest/gtest.h>

#include <algorithm>

#include "server/voxel/gl/attribute_pass.h"
#include "server/voxel/gl/occupancy/tile_device.h"
#include "tests/gpu/voxel/pipelines.h"

namespace voxeld::pipelines {
namespace {

TEST(Limits, more_triangles_than_a_window_holds_give_the_same_in_any_order) {
  constexpr int kCount = 20'000;
  const Scene one = soup(20, {.count = kCount, .extent = 64, .size_max = 2, .colors = true});
  Scene many;
  const size_t copies = kWindowTrianglesMax / kCount + 2;
  for (size_t i = 0; i < copies; ++i) many.parts.push_back(one.parts[0]);
  const VoxelizeOptions options = unit_cells({64, 64, 64});
  const Grid expected = voxelize(one, options, PipelineChoice::kCompute);
  VoxelizeStats stats;
  const Grid grid = voxelize(many, options, PipelineChoice::kCompute, &stats);
  EXPECT_GT(stats.triangles, static_cast<int64_t>(kWindowTrianglesMax));
  // Every sum is a multiple of the single mesh's, so that the means are equal up to rounding.
  ASSERT_EQ(grid.tiles.size(), 1u);
  EXPECT_EQ(grid.tiles[0].brick_morton, expected.tiles[0].brick_morton);
  EXPECT_EQ(grid.tiles[0].masks, expected.tiles[0].masks);
  int largest = 0;
  for (size_t i = 0; i < grid.tiles[0].color.size(); ++i) {
    largest = std::max(largest, std::abs(grid.tiles[0].color[i] - expected.tiles[0].color[i]));
  }
  EXPECT_LE(largest, 1);
}

TEST(Limits, a_tile_with_more_voxels_than_the_sums_hold_is_summed_in_parts) {
  MeshPart part;
  for (int z = 0; z < 90; ++z) {
    const double h = z + 0.5;
    add_quad(part, {glm::dvec3(0, 0, h), {256, 0, h}, {256, 256, h}, {0, 256, h}});
    for (int i = 0; i < 4; ++i) part.colors.emplace_back(z % 2, (z + 1) % 2, 0, 1);
  }
  VoxelizeOptions options = unit_cells({256, 256, 90});
  options.channels = ChannelSet{.color = true, .normal = true};
  const Grid grid = voxelize(scene_of(std::move(part)), options, PipelineChoice::kCompute);
  ASSERT_EQ(grid.tiles.size(), 1u);
  ASSERT_EQ(grid.tiles[0].voxel_count(), size_t{90} * 256 * 256);
  ASSERT_GT(grid.tiles[0].voxel_count() * 7 * 4, 2 * kSumsBytesMax);
  size_t wrong = 0;
  for_each_voxel(grid.tiles[0], [&](int, int, int z, size_t index) {
    wrong += grid.tiles[0].color[4 * index] != (z % 2 == 1 ? 255 : 0);
    wrong += grid.tiles[0].normal[3 * index + 2] != 127;
  });
  EXPECT_EQ(wrong, 0u);
}

TEST(Limits, progress_counts_tiles_and_false_cancels) {
  const Scene scene = soup(21, {.count = 200, .extent = 600, .size_max = 100});
  VoxelizeOptions options = unit_cells({600, 600, 600});
  for (const PipelineChoice pipeline : kPipelines) {
    options.pipeline = pipeline;
    std::vector<int64_t> seen;
    int64_t half = 0;
    auto grid = voxelizer().voxelize(
        scene, options,
        [&](int64_t done, int64_t total) {
          const bool is_prepared = total > 0;
          EXPECT_TRUE(is_prepared || (done == 0 && seen.empty())) << "0 of 0, and first of all";
          if (!is_prepared) return true;
          seen.push_back(done);
          half = total / 2;
          return done < half;
        },
        nullptr);
    ASSERT_FALSE(grid.ok());
    EXPECT_EQ(grid.error().code, ErrorCode::kCancelled);
    EXPECT_EQ(grid.error().message(), "the job was cancelled while it was voxelized");
    EXPECT_GE(half, 10);
    EXPECT_GE(seen.back(), half);
    EXPECT_EQ(seen.front(), 0);
    EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
    // Tiles of raster come one by one; those of the others some at a time.
    const auto calls = static_cast<int64_t>(seen.size()) - 1;
    EXPECT_TRUE(pipeline == PipelineChoice::kRaster ? calls == half : calls <= half) << calls;
    EXPECT_GE(calls, 2);
  }
}

TEST(Limits, a_grid_over_the_memory_limit_is_refused_with_estimate_and_limit) {
  const Scene scene = soup(22, {.count = 500, .extent = 600, .size_max = 200});
  const VoxelizeOptions options = unit_cells({600, 600, 600});
  const auto estimate = voxelizer().estimate(scene, options);
  ASSERT_TRUE(estimate.ok()) << estimate.error().message();
  voxelizer().set_host_bytes_max(estimate->host_bytes - 1);
  const auto refused_estimate = voxelizer().estimate(scene, options);
  const auto refused = voxelizer().voxelize(scene, options, {}, nullptr);
  voxelizer().set_host_bytes_max(int64_t{64} << 30);
  ASSERT_FALSE(refused.ok());
  ASSERT_FALSE(refused_estimate.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kGridTooLarge);
  const std::string bytes = std::to_string(estimate->host_bytes);
  const std::string limit = std::to_string(estimate->host_bytes - 1);
  EXPECT_EQ(
      refused.error().message(),
      "a grid of 600 x 600 x 600 cells of this mesh needs too much memory: expected at most " +
          limit + " bytes, got an estimate of " + bytes + " bytes");
  EXPECT_EQ(refused_estimate.error().message(), refused.error().message());
}

TEST(Limits, estimates_are_not_exceeded) {
  const Scene scene = soup(23, {.count = 2000, .extent = 300, .size_max = 60, .colors = true});
  VoxelizeOptions options = unit_cells({300, 300, 300});
  options.channels = ChannelSet{.color = true, .normal = true};
  const auto estimate = voxelizer().estimate(scene, options);
  ASSERT_TRUE(estimate.ok()) << estimate.error().message();
  EXPECT_EQ(estimate->spec.dims, glm::ivec3(300));
  VoxelizeStats stats;
  const Grid grid = voxelize(scene, options, PipelineChoice::kAuto, &stats);
  EXPECT_EQ(stats.tiles, estimate->tiles);
  size_t bytes = 0;
  for (const SparseTile& tile : grid.tiles) {
    bytes += tile.masks.size() * (sizeof(BrickMask) + 4) + tile.color.size() + tile.normal.size();
  }
  EXPECT_LE(static_cast<int64_t>(bytes), estimate->host_bytes);
  const bool is_software = gpu::test_context().info().is_software;
  EXPECT_EQ(stats.pipeline, is_software ? Pipeline::kCpu : Pipeline::kCompute);
  EXPECT_NE(stats.pipeline_reason, "");
}

TEST(Limits, a_scene_without_triangles_is_an_empty_mesh) {
  const auto grid = voxelizer().voxelize(Scene(), VoxelizeOptions(), {}, nullptr);
  ASSERT_FALSE(grid.ok());
  EXPECT_EQ(grid.error().code, ErrorCode::kEmptyMesh);
  EXPECT_EQ(grid.error().message(), "the mesh has no triangles");
}

TEST(Limits, a_vertex_at_infinity_is_refused_by_name) {
  MeshPart part;
  part.name = "wing";
  add_triangle(part, {0, 0, 0}, {1e308, 0, 0}, {0, 1, 0});
  VoxelizeOptions options;
  options.placement.bounds = {0, 0, 0, 1e-3, 1e-3, 1e-3};
  const auto grid = voxelizer().voxelize(scene_of(part), options, {}, nullptr);
  ASSERT_FALSE(grid.ok());
  EXPECT_EQ(grid.error().code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(grid.error().message(),
            "part \"wing\" has a vertex that is not at a finite place in the grid");
}

}  // namespace
}  // namespace voxeld::pipelines
