// Section planes between cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "server/render/cpu/cpu_renderer.h"

namespace voxeld {
namespace {

constexpr int kSide = 16, kPixels = 64;

// Every cell is occupied. Neither the origin nor the voxel size is a binary fraction.
Grid full_cube() {
  Grid grid;
  grid.spec.dims = glm::ivec3(kSide);
  grid.spec.voxel_size = glm::dvec3(0.1);
  grid.spec.origin_world = {0.3, -1.7, 5.1};
  SparseTile tile;
  tile.full = {{0, 1}};
  grid.tiles = {tile};
  return grid;
}

// The hits of pixels that meet the grid. Cells from `cell` on along the axis are cut away, or, if
// `flipped`, the others.
std::vector<Hit> hits_of_section(const Grid& grid, int axis, int cell, bool flipped) {
  RenderOptions options;
  options.width = options.height = kPixels;
  options.azimuth_deg = 30;
  options.elevation_deg = 20;
  const double sign = flipped ? -1 : 1;
  std::array<double, 4> plane{};
  plane[static_cast<size_t>(axis)] = sign;
  plane[3] = -sign * (grid.spec.origin_world[axis] + cell * grid.spec.voxel_size[axis]);
  options.section = plane;
  CpuRenderer renderer;
  EXPECT_TRUE(renderer.set_grid(grid).ok());
  auto hits = renderer.render_hits(options);
  EXPECT_TRUE(hits.ok());
  std::erase_if(*hits, [](const Hit& hit) { return hit.face < 0; });
  return *hits;
}

TEST(Section, a_plane_between_cells_shows_no_cell_that_it_cuts_away) {
  const Grid grid = full_cube();
  for (int axis = 0; axis < 3; ++axis) {
    for (int cell = 1; cell < kSide; ++cell) {
      for (const bool flipped : {false, true}) {
        const std::vector<Hit> hits = hits_of_section(grid, axis, cell, flipped);
        EXPECT_GT(hits.size(), 30u) << axis << ' ' << cell;
        const auto wrong = std::ranges::count_if(
            hits, [&](const Hit& hit) { return (hit.cell[axis] >= cell) != flipped; });
        EXPECT_EQ(wrong, 0) << axis << ' ' << cell << ' ' << flipped;
      }
    }
  }
}

TEST(Section, a_plane_on_the_side_of_the_grid_cuts_all_of_it_or_nothing_away) {
  const Grid grid = full_cube();
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_TRUE(hits_of_section(grid, axis, 0, false).empty()) << axis;
    EXPECT_TRUE(hits_of_section(grid, axis, kSide, true).empty()) << axis;
    EXPECT_GT(hits_of_section(grid, axis, kSide, false).size(), 1000u) << axis;
    EXPECT_GT(hits_of_section(grid, axis, 0, true).size(), 1000u) << axis;
  }
}

// The image of the cube in world units of 2^exponent, cut in the middle. The plane's numbers are
// multiplied by `plane_scale`.
std::vector<uint8_t> cut_image(int exponent, double plane_scale) {
  Grid grid = full_cube();
  const double unit = std::ldexp(1.0, exponent);
  grid.spec.voxel_size *= unit;
  grid.spec.origin_world *= unit;
  RenderOptions options;
  options.width = options.height = kPixels;
  options.azimuth_deg = 30;
  options.elevation_deg = 20;
  const double middle = grid.spec.origin_world.z + 0.5 * kSide * grid.spec.voxel_size.z;
  options.section = {0, 0, plane_scale, -plane_scale * middle};
  CpuRenderer renderer;
  EXPECT_TRUE(renderer.set_grid(grid).ok());
  const auto image = renderer.render(options, {});
  EXPECT_TRUE(image.ok());
  return image.ok() ? image->rgba : std::vector<uint8_t>();
}

TEST(Section, an_image_does_not_depend_on_the_unit_of_lengths) {
  const std::vector<uint8_t> image = cut_image(0, 1.0);
  for (const int exponent : {-80, 70}) {
    EXPECT_EQ(cut_image(exponent, 1.0), image) << exponent;
    EXPECT_EQ(cut_image(exponent, std::ldexp(1.0, -90)), image) << exponent;
  }
}

}  // namespace
}  // namespace voxeld
