#include "server/grid/color/palette_entries.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>

#include "server/grid/color/oklab.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

constexpr Rgb kBlack = {0, 0, 0}, kWhite = {255, 255, 255};
constexpr int kSide = 64;

void expect_lab(const Rgb& color, const Lab& expected) {
  const Lab lab = oklab(color);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(lab[c], expected[c], 5e-5) << c;
}

TEST(Oklab, has_the_known_figures_of_white_and_the_primaries) {
  expect_lab(kBlack, {0, 0, 0});
  expect_lab(kWhite, {1, 0, 0});
  expect_lab({255, 0, 0}, {0.62796, 0.22486, 0.12585});
  expect_lab({0, 255, 0}, {0.86644, -0.23389, 0.17950});
  expect_lab({0, 0, 255}, {0.45201, -0.03246, -0.31153});
}

// A square of voxels across an axis, at 37 on it.
Grid plane(int axis, const Rgb& color) {
  std::vector<test::TestVoxel> voxels;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      std::array<int, 3> cell = {37, 37, 37};
      cell[static_cast<size_t>((axis + 1) % 3)] = i;
      cell[static_cast<size_t>((axis + 2) % 3)] = j;
      voxels.push_back({cell, {color[0], color[1], color[2], 255}, {}});
    }
  }
  return test::grid_of({kSide, kSide, kSide}, voxels, true, false);
}

uint32_t own_color(const SparseTile& tile, size_t voxel) {
  if (voxel == kNoAttributes) return 0;
  const uint8_t* c = &tile.color[4 * voxel];
  return c[0] | uint32_t{c[1]} << 8 | uint32_t{c[2]} << 16;
}

Lab mean_of(const Grid& grid, std::span<const Rgb> colors, Dither dither) {
  const VoxelEntries entries = choose_entries(grid, colors, dither, own_color);
  Lab sum{};
  size_t count = 0;
  for (const auto& tile : entries.tiles) {
    for (const uint8_t entry : tile) {
      const Lab lab = oklab(colors[entry]);
      for (size_t c = 0; c < 3; ++c) sum[c] += lab[c];
      ++count;
    }
  }
  for (double& v : sum) v /= static_cast<double>(count);
  return sum;
}

TEST(PaletteEntries, without_dither_each_voxel_has_the_nearest_colour_by_itself) {
  const std::vector<Rgb> colors = {kBlack, {200, 30, 30}, {30, 200, 30}, {190, 190, 190}, kWhite};
  const Grid grid = test::random_grid(5, {60, 50, 40}, 3000, true, false);
  const VoxelEntries entries = choose_entries(grid, colors, Dither::kNone, own_color);
  const auto distance = [](const Lab& a, const Lab& b) {
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
           (a[2] - b[2]) * (a[2] - b[2]);
  };
  ASSERT_EQ(entries.tiles.size(), grid.tiles.size());
  for (size_t t = 0; t < grid.tiles.size(); ++t) {
    ASSERT_EQ(entries.tiles[t].size(), grid.tiles[t].attribute_count());
    for (size_t v = 0; v < entries.tiles[t].size(); ++v) {
      const Lab lab = oklab(rgb_of(own_color(grid.tiles[t], v)));
      for (const Rgb& other : colors) {
        EXPECT_LE(distance(lab, oklab(colors[entries.tiles[t][v]])),
                  distance(lab, oklab(other)) + 1e-6);
      }
    }
  }
  EXPECT_EQ(entries.other, 0);
}

TEST(PaletteEntries, of_equal_colours_the_first_is_taken) {
  const std::vector<Rgb> colors = {kWhite, {90, 90, 90}, {90, 90, 90}};
  const VoxelEntries entries =
      choose_entries(plane(2, {80, 80, 80}), colors, Dither::kNone, own_color);
  EXPECT_EQ(std::ranges::count(entries.tiles[0], 1), kSide * kSide);
}

TEST(PaletteEntries, dither_keeps_the_mean_colour_of_planes_across_every_axis) {
  const std::vector<Rgb> colors = {kBlack, kWhite, {220, 0, 0}, {0, 160, 0}, {0, 0, 255}};
  for (int axis = 0; axis < 3; ++axis) {
    for (const Rgb& color : {Rgb{100, 100, 100}, {60, 60, 60}, {150, 90, 80}, {90, 100, 170}}) {
      const Grid grid = plane(axis, color);
      const Lab own = oklab(color);
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(mean_of(grid, colors, Dither::kBayer)[c], own[c], 1.0 / 16);
        EXPECT_NEAR(mean_of(grid, colors, Dither::kError)[c], own[c], 0.01);
      }
      // The nearest alone is not that near.
      EXPECT_GT(std::abs(mean_of(grid, colors, Dither::kNone)[0] - own[0]), 0.01);
    }
  }
}

TEST(PaletteEntries, bayer_mixes_sixteenths_in_every_square_of_four_cells) {
  const std::vector<Rgb> colors = {kWhite, kBlack};
  std::map<int, int> counts;
  for (const uint8_t grey : std::initializer_list<uint8_t>{10, 40, 80, 120, 170, 200}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Grid grid = plane(axis, {grey, grey, grey});
      const VoxelEntries entries = choose_entries(grid, colors, Dither::kBayer, own_color);
      std::map<std::array<int, 3>, int> white;  // by square
      size_t voxel = 0;
      for_each_voxel(grid.tiles[0], [&](int x, int y, int z, size_t) {
        white[{x / 4, y / 4, z / 4}] += entries.tiles[0][voxel++] == 0 ? 1 : 0;
      });
      const int wanted = static_cast<int>(std::lround(16 * oklab({grey, grey, grey})[0]));
      for (const auto& [square, count] : white) {
        EXPECT_NEAR(count, wanted, 1);
        EXPECT_EQ(count, white.begin()->second);
      }
      ++counts[white.begin()->second];
    }
  }
  EXPECT_EQ(counts.size(), 6u);  // every grey has a mixture of its own
}

TEST(PaletteEntries, colours_that_no_mixture_has_stay_at_the_nearest_end) {
  const std::vector<Rgb> colors = {{80, 80, 80}, {160, 160, 160}};
  for (const Dither dither : {Dither::kBayer, Dither::kError}) {
    const VoxelEntries entries = choose_entries(plane(1, kWhite), colors, dither, own_color);
    EXPECT_EQ(std::ranges::count(entries.tiles[0], 1), kSide * kSide);
  }
}

TEST(PaletteEntries, a_colour_far_away_does_not_speckle_a_surface_that_is_nearly_right) {
  // The mean of a white that is a little yellow would need a yellow voxel in twenty.
  const std::vector<Rgb> colors = {{235, 235, 235}, {250, 200, 40}};
  for (const Dither dither : {Dither::kBayer, Dither::kError}) {
    const VoxelEntries entries =
        choose_entries(plane(0, {238, 236, 230}), colors, dither, own_color);
    EXPECT_EQ(std::ranges::count(entries.tiles[0], 0), kSide * kSide);
  }
}

TEST(PaletteEntries, a_palette_with_the_voxels_own_colours_keeps_them_with_dither_too) {
  Grid grid = test::random_grid(8, {40, 40, 40}, 500, true, false);
  std::vector<Rgb> colors;
  for (size_t v = 0; v < 200; ++v) colors.push_back(rgb_of(own_color(grid.tiles[0], v)));
  std::vector<test::TestVoxel> voxels;
  for (size_t v = 0; v < colors.size(); ++v) {
    const auto [r, g, b] = colors[v];
    voxels.push_back({{static_cast<int>(v) % 20, static_cast<int>(v) / 20, 3}, {r, g, b, 255}, {}});
  }
  grid = test::grid_of({20, 10, 4}, voxels, true, false);
  for (const Dither dither : {Dither::kNone, Dither::kBayer, Dither::kError}) {
    const VoxelEntries entries = choose_entries(grid, colors, dither, own_color);
    ASSERT_EQ(entries.tiles[0].size(), colors.size());
    for (size_t v = 0; v < entries.tiles[0].size(); ++v) {
      EXPECT_EQ(colors[entries.tiles[0][v]], rgb_of(own_color(grid.tiles[0], v)));
    }
  }
}

TEST(PaletteEntries, error_diffusion_reaches_over_gaps_of_the_surface_only_to_its_neighbours) {
  // Two voxels that touch at a corner share their error; one apart from both does not.
  const std::array<uint8_t, 4> grey = {100, 100, 100, 255};
  const std::vector<Rgb> colors = {kBlack, kWhite};
  const Grid touching =
      test::grid_of({8, 8, 8}, {{{1, 1, 1}, grey, {}}, {{2, 2, 2}, grey, {}}}, true, false);
  const Grid apart =
      test::grid_of({8, 8, 8}, {{{1, 1, 1}, grey, {}}, {{3, 3, 3}, grey, {}}}, true, false);
  EXPECT_GT(oklab({100, 100, 100})[0], 0.25);
  const auto first = choose_entries(touching, colors, Dither::kError, own_color).tiles[0];
  EXPECT_EQ(first[0] + first[1], 1);
  const auto second = choose_entries(apart, colors, Dither::kError, own_color).tiles[0];
  EXPECT_EQ(second[0], second[1]);
}

}  // namespace
}  // namespace voxeld
