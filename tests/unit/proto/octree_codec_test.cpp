#include "proto/codec/octree_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "tests/unit/proto/tile_maker.h"

namespace voxeld {
namespace {

SparseTile one_tile(const std::vector<test::TestVoxel>& voxels) {
  auto tiles = test::tiles_of(voxels, false, false);
  EXPECT_EQ(tiles.size(), 1u);
  return tiles[0];
}

void expect_octree_round_trip(const SparseTile& tile, bool has_attributes = false) {
  const auto octree = octree_from_tile(tile);
  SparseTile back;
  back.coord = tile.coord;
  const Status status = tile_from_octree(octree, has_attributes, back);
  ASSERT_TRUE(status) << status.error().message();
  EXPECT_TRUE(back == tile);
}

std::string octree_refusal(std::span<const uint8_t> octree) {
  SparseTile tile;
  const Status status = tile_from_octree(octree, false, tile);
  EXPECT_FALSE(status);
  return status ? "" : status.error().message();
}

TEST(OctreeCodec, a_single_voxel_is_one_mask_on_each_level) {
  const SparseTile tile = one_tile({{{0b10000001, 0b01000001, 0b00100001}, {}, {}}});
  // From the root down: bits 7 to 0 of x, y and z; the last mask is the cell in its node.
  const std::vector<uint8_t> expected = {1 << 1, 1 << 2, 1 << 4, 1 << 0,
                                         1 << 0, 1 << 0, 1 << 0, 1 << 7};
  EXPECT_EQ(octree_from_tile(tile), expected);
  expect_octree_round_trip(tile);
}

TEST(OctreeCodec, voxels_in_opposite_corners_share_only_the_root) {
  const SparseTile tile = one_tile({{{0, 0, 0}, {}, {}}, {{255, 255, 255}, {}, {}}});
  const std::vector<uint8_t> expected = {0x81, 1, 0x80, 1, 0x80, 1, 0x80, 1,
                                         0x80, 1, 0x80, 1, 0x80, 1, 0x80};
  EXPECT_EQ(octree_from_tile(tile), expected);
  expect_octree_round_trip(tile);
}

SparseTile tile_of_full_masks() {
  SparseTile tile;
  tile.masks.resize(32768);
  for (uint32_t b = 0; b < 32768; ++b) {
    tile.brick_morton.push_back(b);
    tile.masks[b].words.fill(~uint64_t{0});
  }
  return tile;
}

TEST(OctreeCodec, a_full_tile_with_attributes_has_all_nodes_and_the_largest_octree) {
  const SparseTile tile = tile_of_full_masks();
  const auto octree = octree_from_tile(tile);
  EXPECT_EQ(octree.size(), kOctreeBytesMax);
  EXPECT_TRUE(std::ranges::all_of(octree, [](uint8_t mask) { return mask == 0xff; }));
  expect_octree_round_trip(tile, true);
  EXPECT_EQ(octree_refusal(octree), "grid container, octree: a full node is spelled out");
}

TEST(OctreeCodec, a_full_tile_is_one_byte) {
  SparseTile tile;
  tile.full = {{0, 5}};
  EXPECT_EQ(octree_from_tile(tile), std::vector<uint8_t>{0});
  expect_octree_round_trip(tile);
}

TEST(OctreeCodec, a_full_node_of_any_size_is_one_byte_among_its_siblings) {
  // The second child of the root is full; the third leads down to a full brick beside a voxel.
  SparseTile tile;
  tile.full = {{1 << 12, 4}, {2 << 12, 0}};
  tile.brick_morton = {(2 << 12) + 1};
  tile.masks.resize(1);
  tile.masks[0].words[0] = 1;
  const std::vector<uint8_t> expected = {0b110, 0, 1, 1, 1, 0b11, 0, 1, 1, 1};
  EXPECT_EQ(octree_from_tile(tile), expected);
  expect_octree_round_trip(tile);
}

TEST(OctreeCodec, full_nodes_among_others_come_back) {
  for (uint32_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const bool has_attributes = (seed & 1) != 0;
    SparseTile tile = test::tile_with_full_nodes(random, has_attributes, false);
    tile.color.clear();  // the octree does not hold it
    expect_octree_round_trip(tile, has_attributes);
  }
}

TEST(OctreeCodec, eight_full_siblings_are_refused) {
  EXPECT_EQ(octree_refusal(std::vector<uint8_t>{0xff, 0, 0, 0, 0, 0, 0, 0, 0}),
            "grid container, octree: a full node is spelled out");
}

TEST(OctreeCodec, random_tiles_come_back) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const std::array<int, 3> dims = {1 + test::below(random, 256), 1 + test::below(random, 256),
                                     1 + test::below(random, 256)};
    expect_octree_round_trip(one_tile(test::random_voxels(random, dims, 1 << (seed % 14))));
  }
}

TEST(OctreeCodec, every_truncation_and_every_extra_byte_is_refused) {
  std::mt19937 random(1);
  const auto octree = octree_from_tile(one_tile(test::random_voxels(random, {256, 256, 256}, 200)));
  for (size_t size = 0; size < octree.size(); ++size) {
    const std::string text = octree_refusal(std::span(octree).first(size));
    EXPECT_NE(text.find("is cut off"), std::string::npos) << size << ": " << text;
  }
  EXPECT_EQ(octree_refusal({}), "grid container, octree: level 0 is cut off");
  auto longer = octree;
  longer.push_back(1);
  EXPECT_EQ(octree_refusal(longer), "grid container, octree: bytes after the last level");
}

TEST(OctreeCodec, a_zero_byte_where_no_full_node_can_be_is_refused) {
  const auto octree = octree_from_tile(one_tile({{{1, 2, 3}, {}, {}}}));
  for (size_t level = 0; level < octree.size(); ++level) {
    auto broken = octree;
    broken[level] = 0;
    // Down to the bricks it would be a full node, which has no children.
    EXPECT_EQ(octree_refusal(broken),
              level > 5
                  ? "grid container, octree: level " + std::to_string(level) + " has an empty node"
                  : "grid container, octree: bytes after the last level");
  }
}

TEST(OctreeCodec, random_bytes_are_refused_or_are_a_tile_that_gives_the_same_bytes) {
  std::mt19937 random(2);
  int accepted = 0;
  for (int round = 0; round < 2000; ++round) {
    // Few children per node, so that some inputs are long enough for their own levels.
    std::vector<uint8_t> octree(8);
    for (uint8_t& mask : octree) mask = static_cast<uint8_t>(1u << test::below(random, 9));
    SparseTile tile;
    if (!tile_from_octree(octree, false, tile)) continue;
    ++accepted;
    EXPECT_EQ(octree_from_tile(tile), octree);
  }
  EXPECT_GT(accepted, 100);
}

TEST(OctreeCodec, counting_and_decoding_agree) {
  std::mt19937 random(7);
  std::vector<SparseTile> tiles =
      test::tiles_of(test::random_voxels(random, {256, 256, 256}, 5000), ChannelSet());
  SparseTile with_full = tiles[0];
  with_full.brick_morton = {9, 12};
  with_full.masks.assign(2, BrickMask{{1, 0, 3, 0, 0, 0, 0, 7}});
  with_full.full = {{0, 1}, {10, 0}, {512, 3}};
  SparseTile whole;
  whole.full = {{0, kTileLevels}};
  tiles.push_back(with_full);
  tiles.push_back(whole);
  for (const SparseTile& tile : tiles) {
    const auto counts = count_octree(octree_from_tile(tile));
    ASSERT_TRUE(counts) << counts.error().message();
    EXPECT_EQ(counts->bricks, tile.masks.size());
    EXPECT_EQ(counts->voxels, tile.voxel_count());
    EXPECT_EQ(counts->mask_voxels, tile.attribute_count());
  }
  const auto octree = octree_from_tile(tiles[0]);
  for (size_t size = 0; size < octree.size(); size += 1 + size / 20) {
    EXPECT_FALSE(count_octree(std::span(octree).first(size)));
  }
}

}  // namespace
}  // namespace voxeld
