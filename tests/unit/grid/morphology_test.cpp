// Grown, shrunk and hollowed grids, components and labels, compared with loops over all cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <tuple>

#include "server/grid/morphology/component_tiles.h"
#include "server/grid/morphology/remap_tiles.h"
#include "server/grid/morphology/step_tiles.h"
#include "server/grid/region.h"
#include "server/grid/tile_appender.h"
#include "tests/unit/grid/grid_cells.h"

namespace voxeld {
namespace {

using testing::Cell;
using testing::CellValues;
using Cells = std::map<Cell, CellValues>;

constexpr Neighbors kAllNeighbors[] = {Neighbors::kFaces, Neighbors::kEdges, Neighbors::kCorners};

std::vector<Cell> offsets_of(Neighbors neighbors) {
  const int reach = 1 + static_cast<int>(neighbors);
  std::vector<std::tuple<int, int, int, int>> ordered;  // axes, z, y, x
  for (int code = 0; code < 27; ++code) {
    const int x = code % 3 - 1, y = code / 3 % 3 - 1, z = code / 9 - 1;
    const int axes = std::abs(x) + std::abs(y) + std::abs(z);
    if (axes > 0 && axes <= reach) ordered.emplace_back(axes, z, y, x);
  }
  std::ranges::sort(ordered);
  std::vector<Cell> offsets;
  for (const auto& [axes, z, y, x] : ordered) offsets.push_back({x, y, z});
  return offsets;
}

Cell moved(const Cell& cell, const Cell& by) {
  return {cell[0] + by[0], cell[1] + by[1], cell[2] + by[2]};
}

bool is_inside(const Cell& cell, const glm::ivec3& dims) {
  for (size_t c = 0; c < 3; ++c) {
    if (cell[c] < 0 || cell[c] >= dims[static_cast<int>(c)]) return false;
  }
  return true;
}

Cells dilated(const Cells& cells, const glm::ivec3& dims, int steps, Neighbors neighbors) {
  Cells now = cells;
  const std::vector<Cell> offsets = offsets_of(neighbors);
  for (int i = 0; i < steps; ++i) {
    Cells next = now;
    for (const auto& [cell, values] : now) {
      for (const Cell& offset : offsets) {
        const Cell at = moved(cell, offset);
        if (!is_inside(at, dims) || now.contains(at)) continue;
        for (const Cell& back : offsets) {
          const auto source = now.find(moved(at, back));
          if (source == now.end()) continue;
          next[at] = source->second;
          break;
        }
      }
    }
    now = std::move(next);
  }
  return now;
}

Cells eroded(const Cells& cells, int steps, Neighbors neighbors) {
  Cells now = cells;
  const std::vector<Cell> offsets = offsets_of(neighbors);
  for (int i = 0; i < steps; ++i) {
    Cells next;
    for (const auto& [at, values] : now) {
      const Cell& cell = at;
      const auto has = [&](const Cell& offset) { return now.contains(moved(cell, offset)); };
      if (std::ranges::all_of(offsets, has)) next[cell] = values;
    }
    now = std::move(next);
  }
  return now;
}

Cells without(const Cells& cells, const Cells& removed) {
  Cells rest;
  for (const auto& [cell, values] : cells) {
    if (!removed.contains(cell)) rest[cell] = values;
  }
  return rest;
}

Cells largest(const Cells& cells, int count, Neighbors neighbors) {
  const std::vector<Cell> offsets = offsets_of(neighbors);
  std::map<Cell, int> numbers;
  std::vector<std::vector<Cell>> components;
  for (const auto& [start, values] : cells) {
    if (numbers.contains(start)) continue;
    std::vector<Cell> members = {start};
    numbers[start] = 1;
    for (size_t i = 0; i < members.size(); ++i) {
      for (const Cell& offset : offsets) {
        const Cell at = moved(members[i], offset);
        if (!cells.contains(at) || !numbers.emplace(at, 1).second) continue;
        members.push_back(at);
      }
    }
    components.push_back(std::move(members));
  }
  const auto order = [](const std::vector<Cell>& members) {
    Cell first = {1 << 20, 0, 0};
    for (const Cell& cell : members) first = std::min(first, Cell{cell[2], cell[1], cell[0]});
    return std::pair(-static_cast<int64_t>(members.size()), first);
  };
  std::ranges::sort(components, {}, order);
  Cells kept;
  for (size_t i = 0; i < std::min(components.size(), static_cast<size_t>(count)); ++i) {
    for (const Cell& cell : components[i]) kept[cell] = cells.at(cell);
  }
  return kept;
}

// Blocks of cells around the corners of tiles, with holes.
Grid blocks_at_borders(uint32_t seed, bool has_color) {
  std::mt19937 random(seed);
  Grid grid;
  grid.spec.dims = {300, 280, 270};
  grid.channels = {.color = has_color};
  std::set<Cell> cells;
  for (int block = 0; block < 12; ++block) {
    const Cell low = {238 + test::below(random, 50), 236 + test::below(random, 30),
                      240 + test::below(random, 20)};
    const int side = 2 + test::below(random, 9);
    for (int i = 0; i < side * side * side; ++i) {
      const Cell at = moved(low, {i % side, i / side % side, i / side / side});
      if (is_inside(at, grid.spec.dims) && test::below(random, 40) > 0) cells.insert(at);
    }
  }
  for (int i = 0; i < 300; ++i) {
    cells.insert({225 + test::below(random, 75), 225 + test::below(random, 55),
                  230 + test::below(random, 40)});
  }
  std::map<Cell, SparseTile> tiles;
  for (const Cell& cell : cells) {
    const Cell coord = {cell[0] / 256, cell[1] / 256, cell[2] / 256};
    tiles[coord].coord = coord;
  }
  for (auto& [coord, tile] : tiles) {
    std::map<uint32_t, VoxelValues> voxels;
    for (const Cell& cell : cells) {
      if (Cell{cell[0] / 256, cell[1] / 256, cell[2] / 256} != coord) continue;
      VoxelValues values;
      for (uint8_t& part : values.color) part = static_cast<uint8_t>(random());
      voxels[morton_encode(static_cast<uint32_t>(cell[0] % 256),
                           static_cast<uint32_t>(cell[1] % 256),
                           static_cast<uint32_t>(cell[2] % 256))] = values;
    }
    TileAppender out(coord, grid.channels);
    for (const auto& [code, values] : voxels) out.add(code, values);
    grid.tiles.push_back(out.finish());
  }
  normalize_tiles(grid);
  return grid;
}

Cells selected(const Grid& grid, const OutputOptions& options) {
  const GridTiles source(grid);
  const auto selection = Selection::open(source, options);
  EXPECT_TRUE(selection) << selection.error().message();
  return testing::cells_of(testing::tiles_of(selection->tiles()));
}

TEST(Morphology, steps_across_tiles_equal_loops_over_cells) {
  for (const bool has_color : {false, true}) {
    const Grid grid = blocks_at_borders(3, has_color);
    const Cells cells = testing::cells_of(grid.tiles);
    ASSERT_EQ(grid.tiles.size(), 8u);
    for (const Neighbors neighbors : kAllNeighbors) {
      for (const int steps : {1, 3}) {
        SCOPED_TRACE(std::to_string(steps) + " steps, neighbors " +
                     std::to_string(static_cast<int>(neighbors)));
        OutputOptions options;
        options.neighbors = neighbors;
        options.dilate = steps;
        EXPECT_TRUE(selects(options));
        EXPECT_TRUE(selected(grid, options) == dilated(cells, grid.spec.dims, steps, neighbors));
        options.dilate = 0;
        options.erode = steps;
        const Cells smaller = eroded(cells, steps, neighbors);
        EXPECT_TRUE(selected(grid, options) == smaller);
        options.erode = 0;
        options.hollow = steps;
        EXPECT_TRUE(selected(grid, options) == without(cells, smaller));
      }
    }
  }
}

TEST(Morphology, keep_counts_components_over_tiles) {
  const Grid grid = blocks_at_borders(4, true);
  const Cells cells = testing::cells_of(grid.tiles);
  for (const Neighbors neighbors : kAllNeighbors) {
    size_t before = 0;
    for (const int count : {1, 3, 40, 100000}) {
      OutputOptions options;
      options.keep = count;
      options.neighbors = neighbors;
      const Cells kept = selected(grid, options);
      EXPECT_TRUE(kept == largest(cells, count, neighbors)) << count;
      EXPECT_GT(kept.size(), before);
      before = kept.size();
    }
    EXPECT_EQ(before, cells.size());
  }
}

TEST(Morphology, keep_takes_the_first_of_equal_components_by_z_y_x) {
  Grid grid;
  grid.spec.dims = {600, 300, 300};
  for (const Cell& cell : {Cell{0, 0, 299}, Cell{599, 0, 0}, Cell{0, 299, 0}}) {
    TileAppender out({cell[0] / 256, cell[1] / 256, cell[2] / 256}, {});
    out.add(
        morton_encode(static_cast<uint32_t>(cell[0] % 256), static_cast<uint32_t>(cell[1] % 256),
                      static_cast<uint32_t>(cell[2] % 256)),
        {});
    grid.tiles.push_back(out.finish());
  }
  normalize_tiles(grid);
  OutputOptions options;
  options.keep = 1;
  EXPECT_TRUE(selected(grid, options).contains(Cell{599, 0, 0}));
  options.keep = 2;
  EXPECT_FALSE(selected(grid, options).contains(Cell{0, 0, 299}));
}

TEST(Morphology, the_longest_halo_reaches_the_next_tile) {
  Grid grid;
  grid.spec.dims = {400, 6, 6};
  TileAppender out({0, 0, 0}, {});
  out.add(morton_encode(255, 3, 3), {});
  grid.tiles.push_back(out.finish());
  OutputOptions options;
  options.dilate = 64;
  EXPECT_TRUE(selected(grid, options) ==
              dilated(testing::cells_of(grid.tiles), grid.spec.dims, 64, Neighbors::kFaces));
  options.neighbors = Neighbors::kCorners;
  EXPECT_EQ(selected(grid, options).size(), 129u * 6 * 6);
}

TEST(Morphology, full_nodes_shrink_from_their_outer_faces) {
  Grid grid = testing::grid_with_full_nodes(6, 2, true, false);
  const Cells cells = testing::cells_of(grid.tiles);
  for (const Neighbors neighbors : kAllNeighbors) {
    OutputOptions options;
    options.neighbors = neighbors;
    options.hollow = 2;
    EXPECT_TRUE(selected(grid, options) == without(cells, eroded(cells, 2, neighbors)));
    options.keep = 2;
    const Cells kept = largest(cells, 2, neighbors);
    EXPECT_TRUE(selected(grid, options) == without(kept, eroded(kept, 2, neighbors)));
  }
}

TEST(Morphology, stages_come_in_order_and_see_only_the_region) {
  const Grid grid = blocks_at_borders(5, true);
  OutputOptions options;
  options.region = {230, 231, 235, 290, 279, 268};
  const Cells cut = selected(grid, options);
  const glm::ivec3 dims(60, 48, 33);
  options.keep = 2;
  options.dilate = 2;
  options.erode = 1;
  options.hollow = 1;
  options.neighbors = Neighbors::kEdges;
  const Cells grown = dilated(largest(cut, 2, options.neighbors), dims, 2, options.neighbors);
  const Cells closed = eroded(grown, 1, options.neighbors);
  const Cells expected = without(closed, eroded(closed, 1, options.neighbors));
  EXPECT_TRUE(selected(grid, options) == expected);
  // The crop is the box of the voxels that remain, and changes none of them.
  options.crop = true;
  const GridTiles source(grid);
  const auto box = occupied_selection(source, options);
  ASSERT_TRUE(box);
  const auto selection = Selection::open(source, options, *box);
  ASSERT_TRUE(selection);
  EXPECT_EQ(selection->tiles().grid().spec.dims, box->max - box->min);
  Cells shifted;
  for (const auto& [cell, values] : expected) {
    shifted[{cell[0] + 230 - box->min.x, cell[1] + 231 - box->min.y, cell[2] + 235 - box->min.z}] =
        values;
  }
  EXPECT_TRUE(testing::cells_of(testing::tiles_of(selection->tiles())) == shifted);
}

TEST(Morphology, nothing_remains_of_a_thin_surface_that_is_eroded) {
  Grid grid = blocks_at_borders(7, false);
  OutputOptions options;
  options.erode = 20;
  EXPECT_TRUE(selected(grid, options).empty());
  options.crop = true;
  const GridTiles source(grid);
  const auto box = occupied_selection(source, options);
  ASSERT_TRUE(box);
  EXPECT_TRUE(box->empty());
}

TEST(Morphology, voxels_that_dilation_adds_have_full_coverage) {
  Grid grid;
  grid.spec.dims = {8, 8, 8};
  grid.channels = {.coverage = true};
  TileAppender out({0, 0, 0}, grid.channels);
  VoxelValues part;
  part.coverage = 40;
  out.add(morton_encode(4, 4, 4), part);
  grid.tiles.push_back(out.finish());
  const GridTiles source(grid);
  const StepTiles grown(source, StepKind::kDilate, 1, Neighbors::kFaces);
  const auto tile = grown.tile(0);
  ASSERT_TRUE(tile);
  ASSERT_EQ(tile->voxel_count(), 7u);
  EXPECT_EQ(std::ranges::count(tile->coverage, 40), 1);
  EXPECT_EQ(std::ranges::count(tile->coverage, 255), 6);
}

TEST(Remap, changes_all_labels_at_once) {
  Grid grid;
  grid.spec.dims = {8, 8, 8};
  grid.channels = {.label = true};
  TileAppender out({0, 0, 0}, grid.channels);
  uint32_t code = 0;
  for (const uint16_t label : std::vector<uint16_t>{1, 2, 3, 0, 5}) {
    VoxelValues values;
    values.label = label;
    out.add(code++, values);
  }
  grid.tiles.push_back(out.finish());
  OutputOptions options;
  options.remap = {{1, 2}, {2, 1}, {5, 65535}};
  EXPECT_TRUE(selects(options));
  const GridTiles source(grid);
  const auto selection = Selection::open(source, options);
  ASSERT_TRUE(selection);
  const auto tile = selection->tiles().tile(0);
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->label, (std::vector<uint16_t>{2, 1, 3, 0, 65535}));
}

}  // namespace
}  // namespace voxeld
