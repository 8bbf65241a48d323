// Boxes of grids as grids, alone and at levels of detail.
#include "server/grid/region.h"

#include <gtest/gtest.h>

#include "server/grid/level.h"
#include "tests/unit/grid/grid_cells.h"

namespace voxeld {
namespace {

using testing::Cell;
using testing::CellValues;

std::map<Cell, CellValues> inside(const std::map<Cell, CellValues>& cells, const CellBox& box) {
  std::map<Cell, CellValues> out;
  for (const auto& [cell, values] : cells) {
    const glm::ivec3 p(cell[0], cell[1], cell[2]);
    if (glm::all(glm::greaterThanEqual(p, box.min)) && glm::all(glm::lessThan(p, box.max))) {
      const glm::ivec3 at = p - box.min;
      out[{at.x, at.y, at.z}] = values;
    }
  }
  return out;
}

OutputOptions options_of(const std::array<int, 6>& region, int level = 0) {
  OutputOptions options;
  options.region = region;
  options.level = level;
  return options;
}

TEST(Region, holds_the_cells_of_its_box_and_no_others) {
  for (const bool channels : {false, true}) {
    const Grid grid = testing::random_grid(5, {600, 530, 300}, 9000, channels, channels);
    const GridTiles source(grid);
    const auto all = testing::cells_of(grid.tiles);
    for (const CellBox& box :
         {CellBox{{0, 0, 0}, {600, 530, 300}}, CellBox{{1, 2, 3}, {520, 529, 299}},
          CellBox{{250, 250, 250}, {262, 262, 262}}, CellBox{{256, 0, 0}, {512, 256, 256}},
          CellBox{{599, 529, 299}, {600, 530, 300}}}) {
      const RegionTiles region(source, box);
      EXPECT_EQ(region.grid().spec.dims, box.max - box.min);
      EXPECT_EQ(testing::cells_of(testing::tiles_of(region)), inside(all, box)) << box.min.x;
    }
  }
}

TEST(Region, cuts_full_nodes) {
  for (const bool channels : {false, true}) {
    const Grid grid = testing::grid_with_full_nodes(11, 3, channels, channels);
    const GridTiles source(grid);
    const CellBox box{{3, 5, 7}, {560, 255, 200}};
    EXPECT_EQ(testing::cells_of(testing::tiles_of(RegionTiles(source, box))),
              inside(testing::cells_of(grid.tiles), box));
  }
}

TEST(Region, stays_where_it_is_in_the_world) {
  const Grid grid = testing::random_grid(5, {600, 530, 300}, 100, false, false);
  const GridTiles source(grid);
  const RegionTiles region(source, {{10, 20, 30}, {40, 50, 60}});
  EXPECT_EQ(region.grid().spec.origin_world, grid.spec.world_from_grid({10, 20, 30}));
  EXPECT_EQ(region.grid().spec.voxel_size, grid.spec.voxel_size);
}

TEST(Region, of_a_level_has_the_voxels_that_the_whole_level_has) {
  const Grid grid = testing::random_grid(6, {700, 530, 300}, 9000, true, true);
  const GridTiles source(grid);
  for (const int level : {1, 3, 6}) {
    const auto whole =
        testing::cells_of(testing::tiles_of(LevelTiles(source, level, LevelRule::kAny)));
    const OutputOptions options = options_of({101, 30, 77, 640, 513, 299}, level);
    auto selection = Selection::open(source, options);
    ASSERT_TRUE(selection);
    const int side = 1 << level;
    const CellBox box{{101 / side, 30 / side, 77 / side},
                      {639 / side + 1, 512 / side + 1, 298 / side + 1}};
    EXPECT_EQ(selection->box().min, box.min);
    EXPECT_EQ(selection->box().max, box.max);
    EXPECT_EQ(testing::cells_of(testing::tiles_of(selection->tiles())), inside(whole, box));
    const glm::dvec3 corner = glm::dvec3(box.min * side);
    EXPECT_EQ(selection->tiles().grid().spec.origin_world, grid.spec.world_from_grid(corner));
  }
}

TEST(Region, reads_only_tiles_that_it_touches) {
  const Grid grid = testing::random_grid(6, {1000, 1000, 1000}, 30000, false, false);
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  ASSERT_TRUE(bytes);
  int reads = 0;
  const ContainerTiles source(GridReader::open(*bytes).value(), [&]() -> Status {
    ++reads;
    return {};
  });
  ASSERT_GT(source.coords().size(), 40u);
  for (const int level : {0, 2}) {
    reads = 0;
    auto selection = Selection::open(source, options_of({300, 300, 300, 500, 500, 500}, level));
    ASSERT_TRUE(selection);
    EXPECT_FALSE(testing::tiles_of(selection->tiles()).empty());
    EXPECT_EQ(reads, 1) << "level " << level;
  }
}

TEST(Region, outside_of_the_grid_or_empty_is_refused) {
  const Grid grid = testing::random_grid(6, {100, 50, 20}, 10, false, false);
  const GridTiles source(grid);
  for (const std::array<int, 6>& region : {std::array<int, 6>{-1, 0, 0, 10, 10, 10},
                                           {0, 0, 0, 101, 10, 10},
                                           {0, 0, 5, 10, 10, 5},
                                           {7, 0, 0, 6, 10, 10}}) {
    const auto selection = Selection::open(source, options_of(region));
    ASSERT_FALSE(selection);
    EXPECT_EQ(selection.error().code, ErrorCode::kInvalidOption);
    EXPECT_EQ(selection.error().expected,
              "x0,y0,z0,x1,y1,z1 in the grid's cells, from 0,0,0 to 100,50,20, each minimum below "
              "its maximum");
  }
}

}  // namespace
}  // namespace voxeld
