// Grids as lists of cells, and back.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "server/grid/grid.h"
#include "server/grid/tile_source.h"
#include "tests/reference/level_oracle.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::testing {

using Cell = std::array<int, 3>;

struct CellValues {
  std::array<int, 4> color{};
  std::array<int, 3> normal{};
  bool operator==(const CellValues&) const = default;
};

// All occupied cells and what they have; cells of full nodes have nothing.
inline std::map<Cell, CellValues> cells_of(const std::vector<SparseTile>& tiles) {
  std::map<Cell, CellValues> cells;
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t at) {
      CellValues values;
      for (size_t c = 0; c < 4 && !tile.color.empty() && at != kNoAttributes; ++c) {
        values.color[c] = tile.color[4 * at + c];
      }
      for (size_t c = 0; c < 3 && !tile.normal.empty() && at != kNoAttributes; ++c) {
        values.normal[c] = tile.normal[3 * at + c];
      }
      EXPECT_TRUE(cells.emplace(Cell{x, y, z}, values).second) << x << " " << y << " " << z;
    });
  }
  return cells;
}

inline std::vector<reference::LevelVoxel> voxels_of(const Grid& grid) {
  std::vector<reference::LevelVoxel> voxels;
  for (const auto& [cell, values] : cells_of(grid.tiles)) {
    voxels.push_back({cell, values.color, values.normal});
  }
  return voxels;
}

// All tiles of a source; they are what tiles have to be.
inline std::vector<SparseTile> tiles_of(const TileSource& source) {
  std::vector<SparseTile> tiles;
  const Status done = for_each_batch(source, [&](std::vector<SparseTile> batch) -> Status {
    for (SparseTile& tile : batch) tiles.push_back(std::move(tile));
    return {};
  });
  EXPECT_TRUE(done.ok());
  const GridHeader header = container_header(source.grid());
  const auto container = encode_grid(header, tiles);
  EXPECT_TRUE(container) << container.error().message();
  if (!container) return tiles;
  // The contents of the container are canonical and inside the grid.
  const auto reader = GridReader::open(*container);
  EXPECT_TRUE(reader) << reader.error().message();
  if (reader) {
    EXPECT_EQ(reader->decode_tiles().value(), tiles);
  }
  return tiles;
}

// Random clusters of cells in a grid of these dims.
inline Grid random_grid(uint32_t seed, const std::array<int, 3>& dims, int count, bool has_color,
                        bool has_normal) {
  std::mt19937 random(seed);
  Grid grid;
  grid.spec.dims = {dims[0], dims[1], dims[2]};
  grid.spec.origin_world = {1, -2, 0.5};
  grid.spec.voxel_size = {0.25, 0.5, 1};
  grid.channels = {.color = has_color, .normal = has_normal};
  grid.tiles = test::tiles_of(test::random_voxels(random, dims, count), has_color, has_normal);
  normalize_tiles(grid);
  for (SparseTile& tile : grid.tiles) canonicalize(tile);
  return grid;
}

// Tiles with full nodes of three sizes beside other bricks, side by side along x.
inline Grid grid_with_full_nodes(uint32_t seed, int tiles, bool has_color, bool has_normal) {
  std::mt19937 random(seed);
  Grid grid;
  grid.spec.dims = {tiles * limits::kTileSide, limits::kTileSide, limits::kTileSide};
  grid.channels = {.color = has_color, .normal = has_normal};
  for (int i = 0; i < tiles; ++i) {
    SparseTile tile;
    tile.coord = {i, 0, 0};
    tile.full = {{0, 0}, {8, 1}, {64, 2}, {130, 0}};
    for (const uint32_t brick : {1u, 4u, 16u, 131u, 140u, 30000u}) {
      tile.brick_morton.push_back(brick);
      BrickMask& mask = tile.masks.emplace_back();
      for (uint64_t& word : mask.words) word = uint64_t{random()} << 13 | 1;
    }
    const size_t voxels = tile.attribute_count();
    for (size_t v = 0; has_color && v < 4 * voxels; ++v) {
      tile.color.push_back(static_cast<uint8_t>(random()));
    }
    for (size_t v = 0; has_normal && v < 3 * voxels; ++v) {
      tile.normal.push_back(static_cast<int8_t>(test::below(random, 255) - 127));
    }
    canonicalize(tile);
    grid.tiles.push_back(tile);
  }
  return grid;
}

}  // namespace voxeld::testing
