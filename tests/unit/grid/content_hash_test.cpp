#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>

#include "server/grid/content_hash.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

Grid sample() {
  Grid grid;
  grid.spec.dims = {300, 300, 20};
  grid.spec.origin_world = {-1, 0, 2.5};
  grid.spec.voxel_size = {0.5, 0.5, 0.25};
  grid.channels.color = grid.channels.normal = true;
  grid.tiles = test::tiles_of(test::box_voxels({250, 254, 3}, {260, 258, 5}), true, true);
  return grid;
}

TEST(ContentHash, is_an_id_of_64_hex_digits) {
  const std::string id = content_hash(sample());
  ASSERT_EQ(id.size(), 7u + 64u);
  EXPECT_TRUE(id.starts_with("sha256-"));
  EXPECT_EQ(id.find_first_not_of("0123456789abcdef", 7), std::string::npos);
}

// Computed once from the definition in server/grid/README.md by other code: results that are stored
// under a hash must be found again by later versions.
TEST(ContentHash, stays_what_it_was) {
  EXPECT_EQ(content_hash(Grid{}),
            "sha256-84b6f95b590d1ca83d0d55580c2bcdab14f3dd64055850085d11ad1c6658e7bf");
  EXPECT_EQ(content_hash(sample()),
            "sha256-fa3eb5e95e72b4c178fd92fc9aa32dc8c91e9f673776a3b23aa8c936fc750d2b");
}

TEST(ContentHash, does_not_depend_on_the_order_of_tiles_nor_on_empty_ones_nor_on_meta) {
  const Grid grid = sample();
  ASSERT_EQ(grid.tiles.size(), 4u);
  Grid other = grid;
  std::ranges::reverse(other.tiles);
  EXPECT_EQ(content_hash(other), content_hash(grid));
  other.tiles.insert(other.tiles.begin() + 1, SparseTile{});
  EXPECT_EQ(content_hash(other), content_hash(grid));
  other.meta = GridMeta::parse(R"({"device":"another"})");
  EXPECT_EQ(content_hash(other), content_hash(grid));
}

TEST(ContentHash, survives_the_container) {
  const Grid grid = sample();
  const auto bytes = encode_grid(container_header(grid), grid.tiles);
  ASSERT_TRUE(bytes);
  const auto back = grid_from_container(*bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(content_hash(*back), content_hash(grid));
}

TEST(ContentHash, does_not_depend_on_how_full_bricks_are_written_down) {
  Grid grid;
  grid.spec.dims = {256, 256, 256};
  std::mt19937 random(2);
  grid.tiles = {test::tile_with_full_nodes(random, false, false)};
  Grid spelled = grid;
  spelled.tiles = {SparseTile{}};
  for_each_brick(grid.tiles[0], [&](uint32_t morton, const BrickMask& mask, size_t) {
    spelled.tiles[0].brick_morton.push_back(morton);
    spelled.tiles[0].masks.push_back(mask);
  });
  ASSERT_FALSE(grid.tiles[0].full.empty());
  EXPECT_EQ(content_hash(spelled), content_hash(grid));
}

TEST(ContentHash, a_tile_of_full_nodes_alone_counts) {
  Grid grid;
  grid.spec.dims = {256, 256, 256};
  const std::string empty = content_hash(grid);
  grid.tiles.resize(1);
  grid.tiles[0].full = {{0, kTileLevels}};
  normalize_tiles(grid);
  ASSERT_EQ(grid.tiles.size(), 1u);
  EXPECT_NE(content_hash(grid), empty);
}

TEST(ContentHash, each_channel_counts_and_each_of_its_samples) {
  std::set<std::string> hashes;
  std::mt19937 random(3);
  const auto voxels = test::random_voxels(random, {100, 100, 100}, 200);
  for (uint32_t bits = 0; bits < test::kChannelSets; ++bits) {
    Grid grid;
    grid.spec.dims = {100, 100, 100};
    grid.channels = channels_of_bits(bits);
    grid.tiles = test::tiles_of(voxels, grid.channels);
    hashes.insert(content_hash(grid));
    for (const ChannelInfo& info : kChannels) {
      if (!grid.channels.has(info.channel)) continue;
      Grid other = grid;
      for_each_channel(other.tiles[0], [&](Channel channel, auto& samples) {
        if (channel == info.channel) samples.back() ^= 1;
      });
      hashes.insert(content_hash(other));
    }
  }
  EXPECT_EQ(hashes.size(), test::kChannelSets + test::kChannelSets / 2 * kChannelCount);
}

TEST(ContentHash, any_difference_gives_another_hash) {
  const std::vector<std::function<void(Grid&)>> changes = {
      [](Grid&) {},
      [](Grid& g) { g.spec.dims.z = 21; },
      [](Grid& g) { g.spec.dims.x = 301; },
      [](Grid& g) { g.spec.origin_world.x = 0; },
      [](Grid& g) { g.spec.origin_world.z = std::nextafter(2.5, 3.0); },
      [](Grid& g) { g.spec.voxel_size.y = 0.25; },
      [](Grid& g) { g.channels.color = false; },
      [](Grid& g) { g.channels.normal = false; },
      [](Grid& g) {
        g.tiles[0].coord = {0, 0, 1};
      },
      [](Grid& g) { g.tiles[1].masks[0].words[0] ^= 1; },
      [](Grid& g) { g.tiles[3].masks[0].words[7] ^= uint64_t{1} << 63; },
      [](Grid& g) { g.tiles[2].brick_morton[0] += 1; },
      [](Grid& g) { g.tiles[0].color[0] ^= 1; },
      [](Grid& g) { g.tiles[3].color.back() ^= 0x80; },
      [](Grid& g) { g.tiles[0].normal[0] = 126; },
      [](Grid& g) { g.tiles[3].normal.back() = 0; },
      [](Grid& g) { g.tiles.pop_back(); },
      [](Grid& g) {
        g.tiles[0].full = {{0, 0}};
      },
      [](Grid& g) {
        g.tiles[0].full = {{0, 1}};
      },
      [](Grid& g) {
        g.tiles[1].full = {{0, 0}};
      },
      [](Grid& g) { std::swap(g.tiles[0].coord, g.tiles[1].coord); },
  };
  std::set<std::string> hashes;
  for (const auto& change : changes) {
    Grid grid = sample();
    change(grid);
    hashes.insert(content_hash(grid));
  }
  EXPECT_EQ(hashes.size(), changes.size());
}

}  // namespace
}  // namespace voxeld
