// Shapes whose cells are known.
#include <gtest/gtest.h>

#include "tests/gpu/voxel/pipelines.h"

#include <algorithm>

namespace voxeld::pipelines {
namespace {

TEST(Shapes, a_quad_on_a_grid_plane_fills_one_layer) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const int plane : {0, 3, 8}) {
      std::array<glm::dvec3, 4> corners{};
      const std::array<std::array<double, 2>, 4> around = {{{0, 0}, {8, 0}, {8, 8}, {0, 8}}};
      for (size_t i = 0; i < 4; ++i) {
        corners[i][axis] = plane;
        corners[i][(axis + 1) % 3] = around[i][0];
        corners[i][(axis + 2) % 3] = around[i][1];
      }
      MeshPart part;
      add_quad(part, corners);
      const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({8, 8, 8})));
      EXPECT_EQ(cells.size(), 64u) << "axis " << axis << " plane " << plane;
      for (const auto& [cell, voxel] : cells) {
        // The far face of the grid's box stays inside.
        EXPECT_EQ(cell[static_cast<size_t>(axis)], std::min(plane, 7));
      }
    }
  }
}

TEST(Shapes, a_box_fills_exactly_its_faces) {
  MeshPart part;
  add_box(part, {0, 0, 0}, {16, 16, 16});
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({16, 16, 16})));
  EXPECT_EQ(cells.size(), 16u * 16 * 16 - 14 * 14 * 14);
  for (const auto& [cell, voxel] : cells) {
    bool on_a_face = false;
    for (const int c : cell) on_a_face |= c == 0 || c == 15;
    EXPECT_TRUE(on_a_face);
  }
}

TEST(Shapes, a_grid_of_one_cell_is_filled_by_any_mesh) {
  MeshPart part;
  add_triangle(part, {0.2, 0.3, 0.4}, {0.5, 0.9, 0.1}, {0.3, 0.3, 0.8});
  VoxelizeOptions options;
  options.placement.size = 1;
  EXPECT_EQ(voxel_count(voxelize_all(scene_of(part), options)), 1u);
}

TEST(Shapes, a_point_and_a_segment_are_touched_as_such) {
  MeshPart part;
  add_triangle(part, {2.5, 2.5, 2.5}, {2.5, 2.5, 2.5}, {2.5, 2.5, 2.5});
  add_triangle(part, {0.5, 7.5, 0.5}, {7.5, 7.5, 0.5}, {4.5, 7.5, 0.5});
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({8, 8, 8})));
  EXPECT_EQ(cells.size(), 9u);
  EXPECT_TRUE(cells.contains({2, 2, 2}));
  for (int x = 0; x < 8; ++x) EXPECT_TRUE(cells.contains({x, 7, 0})) << x;
}

TEST(Shapes, a_diagonal_segment_through_cell_corners_touches_its_cells_alone) {
  // Snapped vertices stand half a sub-voxel off, so the segment runs through 8 cells of the
  // diagonal and no others.
  MeshPart part;
  add_triangle(part, {0, 0, 0}, {8, 8, 8}, {8, 8, 8});
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({8, 8, 8})));
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(cells.contains({i, i, i})) << i;
  EXPECT_LE(cells.size(), 8u + 7 * 6);
}

TEST(Shapes, a_plane_across_1024_cells_fills_one_layer_and_no_iteration_is_lost) {
  // One invocation per triangle would run 2^20 columns; software drivers stop at 65,535.
  MeshPart part;
  add_quad(part, {glm::dvec3(0, 0, 512), {1024, 0, 512}, {1024, 1024, 512}, {0, 1024, 512}});
  const Grid grid = voxelize_all(scene_of(part), unit_cells({1024, 1024, 1024}));
  EXPECT_EQ(voxel_count(grid), size_t{1024} * 1024);
}

TEST(Shapes, long_triangles_without_area_are_whole) {
  // The diagonal has no dominant axis, so its columns are searched in all their depth.
  MeshPart part;
  for (int i = 0; i < 8; ++i) {
    add_triangle(part, {0, i, 0}, {1024, 1024 - i, 1024}, {512, 512, 512});
  }
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({1024, 1024, 1024})));
  for (int x = 0; x < 1024; ++x) {
    const auto from = cells.lower_bound({x, 0, 0});
    ASSERT_TRUE(from != cells.end() && from->first[0] == x) << "a gap at x = " << x;
  }
}

TEST(Shapes, a_mesh_outside_the_bounds_gives_an_empty_grid) {
  MeshPart part;
  add_triangle(part, {100, 100, 100}, {101, 100, 100}, {100, 101, 100});
  const Grid grid = voxelize_all(scene_of(part), unit_cells({8, 8, 8}));
  EXPECT_TRUE(grid.tiles.empty());
  EXPECT_EQ(grid.spec.dims, glm::ivec3(8));
}

TEST(Shapes, a_triangle_far_larger_than_the_grid_fills_its_layer) {
  MeshPart part;
  add_triangle(part, {-1e6, -1e6, 4.5}, {3e6, -1e6, 4.5}, {-1e6, 3e6, 4.5});
  const Cells cells = cells_of(voxelize_all(scene_of(part), unit_cells({32, 32, 8})));
  EXPECT_EQ(cells.size(), 32u * 32);
  for (const auto& [cell, voxel] : cells) EXPECT_EQ(cell[2], 4);
}

TEST(Shapes, the_transform_and_up_axis_are_applied_to_the_mesh) {
  MeshPart part;
  add_quad(part, {glm::dvec3(0, 0, 2), {4, 0, 2}, {4, 4, 2}, {0, 4, 2}});
  VoxelizeOptions options;
  options.placement.up = UpAxis::kZ;
  options.placement.voxel_size = {1.0, 1.0, 1.0};
  const Grid grid = voxelize_all(scene_of(part), options);
  EXPECT_EQ(grid.spec.dims, glm::ivec3(4, 1, 4));
  EXPECT_EQ(voxel_count(grid), 16u);
}

}  // namespace
}  // namespace voxeld::pipelines
