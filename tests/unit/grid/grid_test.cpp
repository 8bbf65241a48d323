#include "server/grid/grid.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

Grid random_grid(uint32_t seed) {
  std::mt19937 random(seed);
  Grid grid;
  grid.spec.dims = {520, 300, 260};
  grid.spec.origin_world = {1, -2, 1e-3};
  grid.spec.voxel_size = {0.1, 0.1, 0.3};
  grid.channels.color = true;
  grid.channels.normal = true;
  grid.meta = GridMeta::parse(R"({"units":"cm"})");
  grid.tiles = test::tiles_of(test::random_voxels(random, {520, 300, 260}, 2000), true, true);
  return grid;
}

TEST(Grid, normalizing_sorts_tiles_by_morton_order_and_drops_empty_ones) {
  Grid grid = random_grid(1);
  const uint64_t voxels = grid.voxel_count();
  const size_t count = grid.tiles.size();
  ASSERT_GT(count, 6u);
  grid.tiles.insert(grid.tiles.begin(), SparseTile{{1, 1, 0}, {}, {}, {}});
  normalize_tiles(grid);
  EXPECT_EQ(grid.tiles.size(), count);
  EXPECT_EQ(grid.voxel_count(), voxels);
  uint32_t before = 0;
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    const auto& coord = grid.tiles[i].coord;
    const uint32_t code =
        morton_encode(static_cast<uint32_t>(coord[0]), static_cast<uint32_t>(coord[1]),
                      static_cast<uint32_t>(coord[2]));
    EXPECT_TRUE(i == 0 || before < code);
    before = code;
  }
}

TEST(Grid, comes_back_from_its_container) {
  Grid grid = random_grid(2);
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  ASSERT_TRUE(bytes) << bytes.error().message();
  const auto back = grid_from_container(*bytes);
  ASSERT_TRUE(back) << back.error().message();
  normalize_tiles(grid);
  EXPECT_EQ(back->spec.dims, grid.spec.dims);
  EXPECT_EQ(back->spec.origin_world, grid.spec.origin_world);
  EXPECT_EQ(back->spec.voxel_size, grid.spec.voxel_size);
  EXPECT_EQ(back->channels.color, grid.channels.color);
  EXPECT_EQ(back->channels.normal, grid.channels.normal);
  EXPECT_EQ(back->meta, grid.meta);
  EXPECT_TRUE(back->tiles == grid.tiles);
}

TEST(Grid, a_container_with_one_broken_tile_is_refused) {
  const Grid grid = random_grid(3);
  auto bytes = encode_grid(container_header(grid), grid.tiles);
  ASSERT_TRUE(bytes);
  bytes->back() ^= 1;  // the checksum of the last stream
  const auto back = grid_from_container(*bytes);
  ASSERT_FALSE(back);
  EXPECT_EQ(back.error().code, ErrorCode::kBadRequest);
  EXPECT_TRUE(back.error().message().starts_with("grid container, stream: "));
}

TEST(GridMeta, members_of_another_type_count_as_absent) {
  const GridMeta meta =
      GridMeta::parse(R"({"content_hash":7,"algorithm_version":"6","options":{"fill":["band"]}})");
  EXPECT_EQ(meta.content_hash(), "");
  EXPECT_EQ(meta.algorithm_version(), 0);
  EXPECT_FALSE(meta.is_band());
  for (const char* text : {"", "[1]", "null", "{", "{\"options\":3}"}) {
    EXPECT_FALSE(GridMeta::parse(text).is_band()) << text;
    EXPECT_FALSE(GridMeta::parse(text).has_world_distances()) << text;
  }
  EXPECT_EQ(GridMeta::parse("[1]").text(), "{}");
}

TEST(GridMeta, a_band_that_is_thick_enough_tells_sides) {
  const auto band = [](const std::string& more) {
    return GridMeta::parse(R"({"options":{"fill":"band")" + more + "}}");
  };
  EXPECT_EQ(band("").band_voxels(), 1);
  EXPECT_EQ(band(R"(,"thickness":"3")").band_voxels(), 1);
  EXPECT_EQ(band(R"(,"thickness":3)").band_voxels(), 3);
  EXPECT_TRUE(band(R"(,"thickness":2.5)").tells_sides());
  EXPECT_TRUE(band("").with_band_voxels(0.75).tells_sides());
  EXPECT_FALSE(band("").with_band_voxels(0.7).tells_sides());
  EXPECT_FALSE(band(R"(,"distance":"world")").with_band_voxels(0.75).tells_sides());
  const GridMeta shell = GridMeta::parse(R"({"options":{"fill":"shell","thickness":3}})");
  EXPECT_EQ(shell.band_voxels(), 0);
  EXPECT_FALSE(shell.tells_sides());
}

TEST(GridMeta, typed_members_are_those_of_the_text_and_others_are_carried) {
  const std::string text =
      R"({"algorithm_version":6,"content_hash":"sha256-a","options":{"fill":"band"},"units":"m"})";
  const GridMeta meta = GridMeta::parse(text);
  EXPECT_EQ(meta.content_hash(), "sha256-a");
  EXPECT_EQ(meta.algorithm_version(), 6);
  EXPECT_TRUE(meta.is_band());
  EXPECT_EQ(meta.text(), text);
  const GridMeta more = meta.with({{"content_hash", "sha256-b"}});
  EXPECT_EQ(more.content_hash(), "sha256-b");
  EXPECT_EQ(meta.content_hash(), "sha256-a") << "the first one is as it was";
}

TEST(Grid, distances_are_in_voxels_or_in_shortest_edges) {
  Grid grid = random_grid(4);
  EXPECT_EQ(distance_unit(grid), 1.0);
  grid.meta = GridMeta::parse(R"({"options":{"distance":"world"}})");
  EXPECT_EQ(distance_unit(grid), 0.1);
  grid.meta = GridMeta::parse(R"({"options":{"distance":["world"]}})");
  EXPECT_EQ(distance_unit(grid), 1.0);
}

}  // namespace
}  // namespace voxeld
