#include "server/grid/tile_source.h"

#include <gtest/gtest.h>

#include <atomic>

#include "tests/unit/grid/grid_cells.h"

namespace voxeld {
namespace {

TEST(TileSource, a_container_gives_its_tiles_and_place) {
  const Grid grid = testing::random_grid(1, {900, 300, 300}, 3000, true, false);
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  ASSERT_TRUE(bytes);
  const ContainerTiles source(GridReader::open(*bytes).value());
  EXPECT_EQ(testing::tiles_of(source), grid.tiles);
  EXPECT_EQ(source.grid().spec.dims, grid.spec.dims);
  EXPECT_TRUE(source.grid().channels.color);
  EXPECT_FALSE(source.grid().channels.normal);
}

TEST(TileSource, the_first_error_ends_the_reading) {
  const Grid grid = testing::random_grid(1, {900, 900, 300}, 3000, false, false);
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  std::atomic<int> calls = 0;
  const ContainerTiles source(GridReader::open(*bytes).value(), [&]() -> Status {
    if (++calls > 2) return Error{ErrorCode::kCancelled, "no more", "", ""};
    return {};
  });
  const Status done =
      for_each_batch(source, [](const std::vector<SparseTile>&) -> Status { return {}; });
  ASSERT_FALSE(done.ok());
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
}

TEST(TileSource, some_tiles_are_those_that_are_wanted) {
  const Grid grid = testing::random_grid(1, {900, 900, 300}, 3000, false, false);
  const GridTiles all(grid);
  const SomeTiles some(all, [](const TileCoord& coord) { return coord[0] == 1; });
  std::vector<SparseTile> expected;
  for (const SparseTile& tile : grid.tiles) {
    if (tile.coord[0] == 1) expected.push_back(tile);
  }
  ASSERT_GT(expected.size(), 1u);
  EXPECT_EQ(testing::tiles_of(some), expected);
}

TEST(TileSource, a_cache_reads_tiles_once_until_it_is_full) {
  const Grid grid = testing::random_grid(1, {900, 900, 300}, 3000, false, false);
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  int reads = 0;
  const ContainerTiles source(GridReader::open(*bytes).value(), [&]() -> Status {
    ++reads;
    return {};
  });
  const size_t count = source.coords().size();
  const CachedTiles large(source), none(source, 0);
  for (int round = 0; round < 2; ++round) {
    for (size_t i = 0; i < count; ++i) EXPECT_EQ(large.tile(i).value(), grid.tiles[i]);
  }
  EXPECT_EQ(reads, static_cast<int>(count));
  for (int round = 0; round < 2; ++round) EXPECT_EQ(none.tile(0).value(), grid.tiles[0]);
  EXPECT_EQ(reads, static_cast<int>(count) + 2);
}

TEST(TileSource, the_bytes_of_a_tile_have_all_its_channels) {
  SparseTile tile;
  tile.brick_morton = {3};
  tile.masks.resize(1);
  tile.masks[0].words[0] = 7;  // three voxels
  const size_t without = tile_bytes(tile);
  ChannelSet channels;
  for (const ChannelInfo& info : kChannels) channels.set(info.channel, true);
  resize_channels(tile, channels);
  EXPECT_EQ(tile_bytes(tile), without + 3 * attribute_bytes(channels));
}

TEST(TileSource, the_occupied_box_is_tight) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const Grid grid =
        testing::random_grid(seed, {900, 700, 300}, seed < 10 ? 40 : 3000, false, false);
    CellBox expected{glm::ivec3(1 << 20), glm::ivec3(-1)};
    for (const auto& [cell, values] : testing::cells_of(grid.tiles)) {
      const glm::ivec3 p(cell[0], cell[1], cell[2]);
      expected.min = glm::min(expected.min, p);
      expected.max = glm::max(expected.max, p + 1);
    }
    const GridTiles source(grid);
    const auto box = occupied_box(source);
    ASSERT_TRUE(box);
    EXPECT_EQ(box->min, expected.min);
    EXPECT_EQ(box->max, expected.max);
  }
  const Grid empty;
  EXPECT_TRUE(occupied_box(GridTiles(empty)).value().empty());
}

}  // namespace
}  // namespace voxeld
