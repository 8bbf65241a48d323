#include "server/grid/grid_spec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "proto/limits.h"

namespace voxeld {
namespace {

using Vec = glm::dvec3;

GridSpec placed(const PlacementOptions& options, const Vec& min, const Vec& max) {
  const auto spec = place_grid(options, min, max);
  EXPECT_TRUE(spec) << (spec ? "" : spec.error().message());
  return spec ? *spec : GridSpec{};
}
Error refused(const PlacementOptions& options, const Vec& min, const Vec& max) {
  const auto spec = place_grid(options, min, max);
  EXPECT_FALSE(spec);
  return spec ? Error{} : spec.error();
}

PlacementOptions by_size(int size, int padding = 0) {
  PlacementOptions options;
  options.size = size;
  options.padding = padding;
  return options;
}
PlacementOptions by_dims(int x, int y, int z, int padding = 0) {
  PlacementOptions options;
  options.dims = {x, y, z};
  options.padding = padding;
  return options;
}
PlacementOptions by_voxel(double x, double y, double z, int padding = 0) {
  PlacementOptions options;
  options.voxel_size = {x, y, z};
  options.padding = padding;
  return options;
}

void expect_spec(const GridSpec& spec, const glm::ivec3& dims, const Vec& origin,
                 const Vec& voxel_size) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(spec.dims[c], dims[c]) << "axis " << c;
    EXPECT_DOUBLE_EQ(spec.origin_world[c], origin[c]) << "axis " << c;
    EXPECT_DOUBLE_EQ(spec.voxel_size[c], voxel_size[c]) << "axis " << c;
  }
}

TEST(PlacementBySize, the_longest_side_has_exactly_n_cubic_voxels) {
  expect_spec(placed(by_size(8), Vec(0), Vec(4, 2, 1)), {8, 4, 2}, Vec(0), Vec(0.5));
  expect_spec(placed(by_size(8), Vec(-1, 5, 2), Vec(0, 9, 4)), {2, 8, 4}, {-1, 5, 2}, Vec(0.5));
}

TEST(PlacementBySize, nothing_given_means_128) {
  EXPECT_EQ(placed({}, Vec(0), Vec(1, 2, 1)).dims, glm::ivec3(64, 128, 64));
}

TEST(PlacementBySize, a_side_that_is_no_whole_number_of_voxels_is_covered_and_centred) {
  // Voxels of 1/3: half a unit is 1.5 of them, so 2, which stand out by 1/12 on each side.
  expect_spec(placed(by_size(3), Vec(0), Vec(1, 0.5, 1)), {3, 2, 3}, {0, -1.0 / 12, 0},
              Vec(1.0 / 3));
}

TEST(PlacementBySize, padding_is_part_of_the_size) {
  expect_spec(placed(by_size(8, 2), Vec(0), Vec(4, 2, 1)), {8, 6, 5}, Vec(-2), Vec(1));
}

TEST(PlacementBySize, sides_without_extent_have_one_cell_around_them) {
  expect_spec(placed(by_size(4), Vec(0, 0, 7), Vec(4, 4, 7)), {4, 4, 1}, {0, 0, 6.5}, Vec(1));
  // A point: there is no longest side, so voxels are of 1.
  expect_spec(placed(by_size(64), Vec(3), Vec(3)), {1, 1, 1}, Vec(2.5), Vec(1));
  expect_spec(placed(by_size(64, 2), Vec(3), Vec(3)), {5, 5, 5}, Vec(0.5), Vec(1));
}

TEST(PlacementBySize, the_longest_side_is_n_whatever_the_rounding) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> anywhere(-1000, 1000);
  for (int round = 0; round < 2000; ++round) {
    const Vec a(anywhere(random), anywhere(random), anywhere(random));
    const Vec b(anywhere(random), anywhere(random), anywhere(random));
    const int size = 1 + static_cast<int>(random() % limits::kGridSideMax);
    const GridSpec spec = placed(by_size(size), glm::min(a, b), glm::max(a, b));
    EXPECT_EQ(std::max({spec.dims.x, spec.dims.y, spec.dims.z}), size);
    // The box lies in the grid, up to a fraction of a voxel that snapping takes away.
    for (int c = 0; c < 3; ++c) {
      EXPECT_GE(spec.grid_from_world(glm::min(a, b))[c], -1.0 / 4096);
      EXPECT_LE(spec.grid_from_world(glm::max(a, b))[c], spec.dims[c] + 1.0 / 4096);
    }
  }
}

TEST(PlacementBySize, bounds_replace_the_mesh_s_box) {
  PlacementOptions options = by_size(10);
  options.bounds = {0, 0, 0, 5, 10, 2.5};
  expect_spec(placed(options, Vec(-100), Vec(100)), {5, 10, 3}, {0, 0, -0.25}, Vec(1));
}

TEST(PlacementBySize, padding_without_room_is_refused) {
  const Error error = refused(by_size(8, 4), Vec(0), Vec(1));
  EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
  EXPECT_EQ(error.message(), "padding: expected less than half of size 8, got 4");
  EXPECT_EQ(placed(by_size(9, 4), Vec(0), Vec(1)).dims, glm::ivec3(9));
}

TEST(PlacementByDims, voxels_are_cubic_and_the_box_is_in_the_middle) {
  expect_spec(placed(by_dims(10, 10, 10), Vec(0), Vec(4, 2, 1)), {10, 10, 10}, {0, -1, -1.5},
              Vec(0.4));
  // The tightest side decides: y needs voxels of 1.
  expect_spec(placed(by_dims(10, 2, 10), Vec(0), Vec(4, 2, 1)), {10, 2, 10}, {-3, 0, -4.5}, Vec(1));
}

TEST(PlacementByDims, with_bounds_the_grid_is_exactly_that_box) {
  PlacementOptions options = by_dims(16, 8, 4);
  options.bounds = {-1, -1, -1, 1, 1, 1};
  expect_spec(placed(options, Vec(5), Vec(6)), {16, 8, 4}, Vec(-1), {0.125, 0.25, 0.5});
  options = by_dims(8, 8, 6, 2);
  options.bounds = {0, 0, 0, 4, 2, 4};
  expect_spec(placed(options, Vec(5), Vec(6)), {8, 8, 6}, {-2, -1, -4}, {1, 0.5, 2});
}

TEST(PlacementByDims, padding_and_flat_boxes) {
  expect_spec(placed(by_dims(8, 8, 8, 2), Vec(0), Vec(4, 4, 2)), {8, 8, 8}, {-2, -2, -3}, Vec(1));
  expect_spec(placed(by_dims(8, 4, 2), Vec(0), Vec(0)), {8, 4, 2}, {-4, -2, -1}, Vec(1));
  const Error error = refused(by_dims(8, 8, 4, 2), Vec(0), Vec(1));
  EXPECT_EQ(error.message(), "padding: expected less than half of each of dims, got 2");
}

TEST(PlacementByVoxelSize, as_many_cells_as_cover_the_box) {
  // 2.2, 2 and 0.5 voxels.
  expect_spec(placed(by_voxel(0.5, 0.5, 2), Vec(0), Vec(1.1, 1, 1)), {3, 2, 1},
              {0.55 - 0.75, 0, -0.5}, {0.5, 0.5, 2});
  expect_spec(placed(by_voxel(1, 1, 1, 3), Vec(0), Vec(2, 0, 1)), {8, 7, 7}, {-3, -3.5, -3},
              Vec(1));
}

TEST(PlacementByVoxelSize, a_box_on_grid_planes_gets_no_cell_more_from_rounding) {
  // 0.3 / 0.1 is a little less than 3, 0.7 / 0.1 a little less than 7, 0.6 / 0.2 a little less than
  // 3, and 3 * 1.1 / 1.1 a little more.
  EXPECT_EQ(placed(by_voxel(0.1, 0.1, 0.2), Vec(0), Vec(0.3, 0.7, 0.6)).dims, glm::ivec3(3, 7, 3));
  EXPECT_EQ(placed(by_voxel(1.1, 1, 1), Vec(0), Vec(3 * 1.1, 1, 1)).dims.x, 3);
  for (int n = 1; n <= limits::kGridSideMax; ++n) {
    for (const double voxel : {0.1, 1.0 / 3, 1e-7, 7e20}) {
      EXPECT_EQ(placed(by_voxel(voxel, voxel, voxel), Vec(0), Vec(n * voxel)).dims.x, n);
    }
  }
}

TEST(PlacementByVoxelSize, what_is_more_than_rounding_is_another_cell) {
  EXPECT_EQ(placed(by_voxel(1, 1, 1), Vec(0), Vec(3 + 1.0 / 8192, 3, 3)).dims.x, 3);
  EXPECT_EQ(placed(by_voxel(1, 1, 1), Vec(0), Vec(3 + 1.0 / 2048, 3, 3)).dims.x, 4);
}

TEST(PlacementByVoxelSize, the_largest_grid_is_taken_and_one_cell_more_is_refused) {
  EXPECT_EQ(placed(by_voxel(1, 1, 1), Vec(0), Vec(16384, 1, 1)).dims.x, 16384);
  Error error = refused(by_voxel(1, 1, 1), Vec(0), Vec(1, 16385, 3));
  EXPECT_EQ(error.code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(error.message(),
            "grid dims: expected at most 16384 cells on a side, got 1 x 16385 x 3");
  EXPECT_EQ(refused(by_voxel(1, 1, 1, 1), Vec(0), Vec(16383, 1, 1)).got, "16385 x 3 x 3");
  EXPECT_EQ(refused(by_voxel(1e-300, 1, 1), Vec(0), Vec(1, 2, 3)).got, "over 1e15 x 2 x 3");
  EXPECT_EQ(refused(by_voxel(5e-324, 1, 1), Vec(0), Vec(1e20, 2, 3)).got, "over 1e15 x 2 x 3");
}

TEST(PlacementByVoxelSize, voxels_beyond_any_world_are_refused) {
  EXPECT_EQ(placed(by_voxel(1e30, 1, 1), Vec(0), Vec(1)).dims.x, 1);
  const Error error = refused(by_voxel(1e308, 1, 1, 512), Vec(0), Vec(1));
  EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
  EXPECT_EQ(error.message(), "voxel_size: expected at most 1e30, got 1e+308");
}

TEST(Placement, boxes_that_cannot_be_placed_exactly_are_refused) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refused(by_size(8), Vec(1), Vec(0)).message(),
            "extent of the box to voxelize: expected a finite number of at most 1e30, got -1");
  EXPECT_EQ(refused(by_size(8), Vec(0), Vec(2e30, 1, 1)).got, "2e+30");
  EXPECT_EQ(refused(by_size(8), Vec(0), Vec(1, inf, 1)).got, "inf");
  EXPECT_EQ(refused(by_size(8), Vec(1e12), Vec(1e12) + Vec(1)).message(),
            "the mesh is too small for its distance from the origin to be placed exactly: expected "
            "an extent of at least a billionth of its largest coordinate, got 1 at 1000000000001");
  EXPECT_EQ(refused(by_size(8), Vec(0), Vec(1e-31)).code, ErrorCode::kInvalidOption);
}

TEST(Placement, voxels_that_cannot_be_placed_exactly_are_refused) {
  const Vec far(2e8);
  const Error error = refused(by_size(16384), far, far + Vec(1));
  EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
  EXPECT_EQ(error.message(),
            "voxels are too small for their distance from the origin to be placed exactly: "
            "expected at least 2^-40 of the largest coordinate, got 6.103515625e-05 at 200000001");
  EXPECT_EQ(refused(by_voxel(1e-4, 1, 1), far, far + Vec(1)).code, ErrorCode::kInvalidOption);
  EXPECT_EQ(placed(by_size(4096), far, far + Vec(1)).dims, glm::ivec3(4096));
  // A side without extent is around its one cell.
  EXPECT_EQ(placed(by_voxel(1e-4, 1, 1), far, far + Vec(0, 1, 1)).dims.x, 1);
}

TEST(Placement, bounds_that_are_thin_for_their_distance_cannot_be_cut_into_cells) {
  PlacementOptions options = by_dims(8, 8, 8);
  options.bounds = {0, 0, 1e12, 1e12, 1e12, 1e12 + 1};
  const Error error = refused(options, Vec(0), Vec(1));
  EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
  EXPECT_EQ(error.message(),
            "bounds: expected sides of at least a billionth of their largest coordinate, got 1 at "
            "1000000000001");
  options.bounds = {0, 0, 0, 1, 1, 1e-310};
  EXPECT_EQ(refused(options, Vec(0), Vec(1)).got, "1e-310 at 1e-310");
}

TEST(Placement, a_box_with_a_coordinate_that_is_no_number_is_refused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int c = 0; c < 3; ++c) {
    Vec max(1);
    max[c] = nan;
    EXPECT_EQ(refused(by_size(8), Vec(0), max).code, ErrorCode::kInvalidOption) << c;
    EXPECT_EQ(refused(by_voxel(1, 1, 1), Vec(0), max).code, ErrorCode::kInvalidOption) << c;
  }
}

// The table of examples in server/grid/README.md.
TEST(Placement, the_documented_examples_are_true) {
  const Vec max(4, 2, 1);
  expect_spec(placed(by_size(8), Vec(0), max), {8, 4, 2}, Vec(0), Vec(0.5));
  expect_spec(placed(by_size(8, 2), Vec(0), max), {8, 6, 5}, Vec(-2), Vec(1));
  const GridSpec thirds = placed(by_size(3), Vec(0), max);
  EXPECT_EQ(thirds.dims, glm::ivec3(3, 2, 1));
  EXPECT_NEAR(thirds.origin_world.y, -1.0 / 3, 1e-15);
  EXPECT_NEAR(thirds.origin_world.z, -1.0 / 6, 1e-15);
  expect_spec(placed(by_dims(10, 10, 10), Vec(0), max), {10, 10, 10}, {0, -1, -1.5}, Vec(0.4));
  PlacementOptions boxed = by_dims(10, 10, 10);
  boxed.bounds = {0, 0, 0, 4, 2, 1};
  expect_spec(placed(boxed, Vec(0), Vec(1)), {10, 10, 10}, Vec(0), {0.4, 0.2, 0.1});
  expect_spec(placed(by_voxel(1.5, 1.5, 1.5), Vec(0), max), {3, 2, 1}, {-0.25, -0.5, -0.25},
              Vec(1.5));
}

TEST(GridSpec, grid_and_world_lead_back_to_each_other) {
  GridSpec spec;
  spec.origin_world = {-1, 2, 10};
  spec.voxel_size = {0.5, 0.25, 2};
  EXPECT_EQ(spec.grid_from_world({0, 3, 10}), Vec(2, 4, 0));
  EXPECT_EQ(spec.world_from_grid({2, 4, 0}), Vec(0, 3, 10));
}

TEST(GridSpec, tiles_cover_all_cells) {
  GridSpec spec;
  spec.dims = {1, 256, 257};
  EXPECT_EQ(spec.tile_dims(), glm::ivec3(1, 1, 2));
  spec.dims = glm::ivec3(2048);
  EXPECT_EQ(spec.tile_dims(), glm::ivec3(8));
  EXPECT_EQ(spec.cell_count(), int64_t{1} << 33);
}

TEST(WorldFromFile, z_up_is_turned_about_x_and_the_transform_comes_after) {
  PlacementOptions options;
  EXPECT_EQ(world_from_file(options), glm::dmat4(1));
  options.up = UpAxis::kZ;
  EXPECT_EQ(world_from_file(options) * glm::dvec4(1, 2, 3, 1), glm::dvec4(1, 3, -2, 1));
  // Row-major: twice as wide in x, then moved by (10, 20, 30).
  options.transform = {2, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30, 0, 0, 0, 1};
  EXPECT_EQ(world_from_file(options) * glm::dvec4(1, 2, 3, 1), glm::dvec4(12, 23, 28, 1));
}

}  // namespace
}  // namespace voxeld
