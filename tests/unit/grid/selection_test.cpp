// Mirrored, cropped and recoloured grids, compared with lists of all their cells.
#include <gtest/gtest.h>

#include <algorithm>

#include "server/grid/color/oklab.h"
#include "server/grid/region.h"
#include "tests/unit/grid/grid_cells.h"

namespace voxeld {
namespace {

using testing::Cell;
using testing::CellValues;

std::map<Cell, CellValues> mirrored(const std::map<Cell, CellValues>& cells, const CellBox& box,
                                    const MirrorAxes& axes) {
  std::map<Cell, CellValues> out;
  for (const auto& [cell, values] : cells) {
    Cell at{};
    CellValues changed = values;
    bool is_inside = true;
    for (size_t c = 0; c < 3; ++c) {
      const int low = box.min[static_cast<int>(c)], high = box.max[static_cast<int>(c)];
      is_inside = is_inside && low <= cell[c] && cell[c] < high;
      at[c] = axes[c] ? high - 1 - cell[c] : cell[c] - low;
      if (axes[c]) changed.normal[c] = -changed.normal[c];
    }
    if (is_inside) out[at] = changed;
  }
  return out;
}

TEST(Mirror, reverses_cells_and_normals_along_its_axes) {
  const CellBox all{{0, 0, 0}, {600, 530, 300}}, part{{1, 2, 3}, {520, 529, 299}},
      tile{{256, 0, 0}, {512, 256, 256}};
  for (const bool channels : {false, true}) {
    const Grid grid = testing::random_grid(5, {600, 530, 300}, 9000, channels, channels);
    const GridTiles source(grid);
    const auto cells = testing::cells_of(grid.tiles);
    for (const MirrorAxes& axes :
         {MirrorAxes{true, false, false}, {false, true, true}, {true, true, true}}) {
      for (const CellBox& box : {all, part, tile}) {
        const RegionTiles region(source, box, axes);
        EXPECT_EQ(testing::cells_of(testing::tiles_of(region)), mirrored(cells, box, axes));
        EXPECT_EQ(region.grid().spec.dims, box.max - box.min);
      }
    }
  }
}

TEST(Mirror, keeps_full_nodes) {
  const Grid grid = testing::grid_with_full_nodes(11, 2, true, true);
  const GridTiles source(grid);
  OutputOptions options;
  options.mirror = {true, false, true};
  EXPECT_TRUE(selects(options));
  const auto selection = Selection::open(source, options);
  ASSERT_TRUE(selection);
  EXPECT_EQ(testing::cells_of(testing::tiles_of(selection->tiles())),
            mirrored(testing::cells_of(grid.tiles), {{0, 0, 0}, grid.spec.dims}, options.mirror));
}

TEST(Crop, is_the_box_of_the_occupied_cells_that_are_selected) {
  const Grid grid = testing::random_grid(8, {700, 530, 300}, 40, true, false);
  const GridTiles source(grid);
  for (const int level : {0, 2}) {
    OutputOptions asked;
    asked.crop = true;
    asked.level = level;
    asked.region = {101, 30, 7, 640, 513, 299};
    OutputOptions uncropped = asked;
    uncropped.crop = false;
    const auto whole = Selection::open(source, uncropped);
    ASSERT_TRUE(whole);
    const auto cells = testing::cells_of(testing::tiles_of(whole->tiles()));
    ASSERT_FALSE(cells.empty());
    CellBox expected{glm::ivec3(1 << 20), glm::ivec3(0)};
    for (const auto& [cell, values] : cells) {
      for (size_t c = 0; c < 3; ++c) {
        const auto axis = static_cast<int>(c);
        expected.min[axis] = std::min(expected.min[axis], cell[c]);
        expected.max[axis] = std::max(expected.max[axis], cell[c] + 1);
      }
    }
    const auto box = occupied_selection(source, asked);
    ASSERT_TRUE(box);
    const OutputOptions cropped = crop_to(asked, grid.spec, *box);
    EXPECT_FALSE(cropped.crop);
    const auto selection = Selection::open(source, cropped);
    ASSERT_TRUE(selection);
    EXPECT_EQ(selection->tiles().grid().spec.dims, expected.max - expected.min) << level;
    EXPECT_EQ(testing::cells_of(testing::tiles_of(selection->tiles())),
              mirrored(cells, expected, {}));
    EXPECT_EQ(selection->tiles().grid().spec.origin_world,
              whole->tiles().grid().spec.world_from_grid(glm::dvec3(expected.min)));
  }
}

TEST(Crop, of_a_grid_without_voxels_is_the_grid) {
  Grid grid;
  grid.spec.dims = {10, 20, 30};
  const GridTiles source(grid);
  OutputOptions asked;
  asked.crop = true;
  EXPECT_TRUE(selects(asked));
  const auto box = occupied_selection(source, asked);
  ASSERT_TRUE(box);
  EXPECT_TRUE(box->empty());
  EXPECT_FALSE(selects(crop_to(asked, grid.spec, *box)));
}

TEST(Palette, gives_each_voxel_the_nearest_colour_and_keeps_its_alpha) {
  const Grid grid = testing::random_grid(9, {300, 200, 40}, 3000, true, true);
  const GridTiles source(grid);
  OutputOptions options;
  options.palette = {{0, 0, 0}, {255, 255, 255}, {200, 30, 30}, {20, 20, 180}};
  EXPECT_TRUE(selects(options));
  const auto selection = Selection::open(source, options);
  ASSERT_TRUE(selection);
  auto expected = testing::cells_of(grid.tiles);
  for (auto& [cell, values] : expected) {
    const Lab own =
        oklab({static_cast<uint8_t>(values.color[0]), static_cast<uint8_t>(values.color[1]),
               static_cast<uint8_t>(values.color[2])});
    const auto distance = [&](const PaletteColor& color) {
      const Lab lab = oklab(color);
      double sum = 0;
      for (size_t c = 0; c < 3; ++c) sum += (lab[c] - own[c]) * (lab[c] - own[c]);
      return sum;
    };
    const auto nearest = std::ranges::min_element(options.palette, {}, distance);
    std::ranges::copy(*nearest, values.color.begin());
  }
  EXPECT_EQ(testing::cells_of(testing::tiles_of(selection->tiles())), expected);
}

TEST(Palette, leaves_voxels_without_a_colour_as_they_are) {
  Grid grid;
  grid.spec.dims = {8, 8, 8};
  grid.channels = {.color = true};
  grid.tiles = test::tiles_of(
      {{.cell = {0, 0, 0}, .color = {250, 250, 250, 255}}, {.cell = {1, 0, 0}}}, grid.channels);
  const GridTiles source(grid);
  OutputOptions options;
  options.palette = {{10, 20, 30}, {255, 255, 255}};
  for (const Dither dither : {Dither::kNone, Dither::kBayer, Dither::kError}) {
    options.dither = dither;
    const auto selection = Selection::open(source, options);
    ASSERT_TRUE(selection);
    const auto cells = testing::cells_of(testing::tiles_of(selection->tiles()));
    EXPECT_EQ(cells.at({0, 0, 0}).color, (std::array<int, 4>{255, 255, 255, 255}));
    EXPECT_EQ(cells.at({1, 0, 0}).color, (std::array<int, 4>{}));
  }
}

TEST(Palette, of_a_vox_is_left_to_its_encoder) {
  OutputOptions options;
  options.palette = {{0, 0, 0}};
  options.format = Format::kVox;
  EXPECT_FALSE(selects(options));
  EXPECT_FALSE(recolors(options));
}

}  // namespace
}  // namespace voxeld
