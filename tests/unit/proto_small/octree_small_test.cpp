#include "proto/codec/octree_small.h"

#include <gtest/gtest.h>

#include <string>

#include "proto/codec/octree_codec.h"
#include "tests/unit/proto/tile_maker.h"
#include "tests/unit/proto_small/small_shapes.h"

namespace voxeld {
namespace {

// Returns the bytes.
std::vector<uint8_t> expect_round_trip(const SparseTile& tile, bool has_attributes = false) {
  const auto bytes = encode_octree_small(tile);
  SparseTile back;
  back.coord = tile.coord;
  const Status status = decode_octree_small(bytes, has_attributes, back);
  EXPECT_TRUE(status) << status.error().message();
  EXPECT_TRUE(back == tile);
  return bytes;
}

std::string refusal(std::span<const uint8_t> bytes) {
  SparseTile tile;
  const Status status = decode_octree_small(bytes, false, tile);
  EXPECT_FALSE(status);
  return status ? "" : status.error().message();
}

double bits_per_voxel(const SparseTile& tile, size_t bytes) {
  return 8.0 * static_cast<double>(bytes) / static_cast<double>(tile.voxel_count());
}

TEST(OctreeSmall, single_voxels_come_back_from_few_bytes) {
  for (const int at : {0, 1, 7, 8, 127, 128, 200, 255}) {
    const auto bytes = expect_round_trip(test::single_voxel(at, 255 - at, at / 2));
    EXPECT_LE(bytes.size(), 16u);
  }
}

TEST(OctreeSmall, a_full_tile_is_one_byte) {
  EXPECT_EQ(expect_round_trip(test::full_tile()), std::vector<uint8_t>{2});
}

TEST(OctreeSmall, full_nodes_among_others_come_back) {
  for (uint32_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const bool has_attributes = (seed & 1) != 0;
    SparseTile tile = test::tile_with_full_nodes(random, has_attributes, false);
    tile.color.clear();  // the octree does not hold it
    expect_round_trip(tile, has_attributes);
  }
}

TEST(OctreeSmall, a_large_full_node_costs_only_its_place) {
  SparseTile tile = test::single_voxel(255, 255, 255);
  const size_t alone = expect_round_trip(tile).size();
  tile.full = {{0, 4}};
  EXPECT_LE(expect_round_trip(tile).size(), alone + 4);
}

TEST(OctreeSmall, solids_cost_as_much_as_their_surface) {
  const SparseTile solid = test::ball(100);
  const SparseTile shell = test::sphere_shell(98, 2);
  const size_t solid_bytes = expect_round_trip(solid).size();
  const size_t shell_bytes = expect_round_trip(shell).size();
  EXPECT_LT(solid_bytes, 2 * shell_bytes);
}

TEST(OctreeSmall, shells_need_less_than_a_bit_for_a_voxel) {
  for (const int radius : {40, 100, 120}) {
    const SparseTile tile = test::sphere_shell(radius, 2);
    EXPECT_LT(bits_per_voxel(tile, expect_round_trip(tile).size()), 0.8) << radius;
  }
}

TEST(OctreeSmall, planes_come_back) {
  for (const auto& [a, b, c, d] : {std::array{1, 0, 0, 128}, std::array{0, 1, 0, 0},
                                   std::array{0, 0, 1, 255}, std::array{3, 5, 7, 1900}}) {
    const SparseTile tile = test::plane(a, b, c, d);
    EXPECT_LT(bits_per_voxel(tile, expect_round_trip(tile).size()), 0.8) << a << b << c;
  }
}

TEST(OctreeSmall, a_checkerboard_comes_back) {
  expect_round_trip(test::checkerboard());
}

TEST(OctreeSmall, noise_of_any_density_comes_back) {
  for (const uint32_t one_in : {3u, 100u, 1000u, 100'000u}) {
    SCOPED_TRACE(one_in);
    expect_round_trip(test::noise(one_in, one_in));
  }
}

TEST(OctreeSmall, full_bricks_beside_others_come_back) {
  std::mt19937 random(5);
  SparseTile tile;
  for (uint32_t morton = 0; morton < 8192; ++morton) {
    const auto kind = random() % 4;
    if (kind == 0) continue;
    tile.brick_morton.push_back(morton);
    BrickMask& mask = tile.masks.emplace_back();
    for (uint64_t& word : mask.words) word = kind == 1 ? uint64_t{random()} | 1 : ~uint64_t{0};
  }
  expect_round_trip(tile, true);  // full bricks with attributes are told cell by cell
  canonicalize(tile);
  EXPECT_FALSE(tile.full.empty());
  expect_round_trip(tile);
}

TEST(OctreeSmall, an_octant_of_full_bricks_alone_has_no_stream) {
  const SparseTile tile = test::tile_where([](int x, int y, int z) {
    return (x < 128 && y < 128 && z < 128) || (x >= 128 && (x + y + z) % 7 == 0);
  });
  const auto bytes = expect_round_trip(tile);
  ASSERT_EQ(bytes[0], 1);
  EXPECT_EQ(std::vector<uint8_t>(bytes.begin() + 5, bytes.begin() + 9), std::vector<uint8_t>(4));
}

TEST(OctreeSmall, random_tiles_come_back) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const std::array<int, 3> dims = {1 + test::below(random, 256), 1 + test::below(random, 256),
                                     1 + test::below(random, 256)};
    const auto tiles =
        test::tiles_of(test::random_voxels(random, dims, 1 << (seed % 14)), false, false);
    ASSERT_EQ(tiles.size(), 1u);
    expect_round_trip(tiles[0]);
  }
}

TEST(OctreeSmall, the_number_of_voxels_decides_between_whole_and_octants) {
  // Rows of 256 voxels, so that the numbers are exact.
  const auto rows = [](int count) {
    return test::tile_where([=](int, int y, int z) { return y + 256 * z < count; });
  };
  EXPECT_EQ(expect_round_trip(rows(1024))[0], 0);
  EXPECT_EQ(expect_round_trip(rows(1025))[0], 1);
}

TEST(OctreeSmall, every_truncation_and_an_extra_byte_are_refused) {
  for (const SparseTile& tile : {test::sphere_shell(20, 1), test::noise(3, 50)}) {
    auto bytes = encode_octree_small(tile);
    const size_t step = 1 + bytes.size() / 500;
    for (size_t size = 0; size < bytes.size(); size += step) {
      EXPECT_NE(refusal(std::span<const uint8_t>(bytes).first(size)), "") << size;
    }
    EXPECT_NE(refusal(std::span<const uint8_t>(bytes).first(bytes.size() - 1)), "");
    bytes.push_back(0);
    EXPECT_NE(refusal(bytes), "");
  }
}

TEST(OctreeSmall, an_error_names_its_cause) {
  EXPECT_EQ(refusal({}), "grid container, small octree: no bytes");
  EXPECT_EQ(refusal(std::vector<uint8_t>{3}),
            "grid container, small octree: layout: expected 0, 1 or 2, got 3");
  EXPECT_EQ(refusal(std::vector<uint8_t>{2, 0}),
            "grid container, small octree: bytes after a full tile");
  EXPECT_EQ(refusal(std::vector<uint8_t>{0}),
            "grid container, small octree: the stream is cut off");
  EXPECT_EQ(refusal(std::vector<uint8_t>(36, 1)),
            "grid container, small octree: the lengths are cut off");
  std::vector<uint8_t> lengths(37);
  lengths[0] = 1;
  EXPECT_EQ(refusal(lengths), "grid container, small octree: the head is cut off");
  lengths[1] = 3;
  EXPECT_EQ(refusal(lengths),
            "grid container, small octree: its streams: expected 40 bytes, got 37");
  auto whole = encode_octree_small(test::single_voxel(1, 2, 3));
  whole.push_back(0);
  EXPECT_EQ(refusal(whole), "grid container, small octree: bytes after the stream");
  auto split = encode_octree_small(test::noise(3, 50));
  split.push_back(0);
  ++split[5 + 4 * 7];
  EXPECT_EQ(refusal(split), "grid container, small octree: bytes after the octant 7");
  split.resize(split.size() - 2);
  split[5 + 4 * 7] = static_cast<uint8_t>(split[5 + 4 * 7] - 2);
  EXPECT_EQ(refusal(split), "grid container, small octree: the octant 7 is cut off");
}

TEST(OctreeSmall, a_full_node_that_is_spelled_out_is_refused) {
  SparseTile tile = test::single_voxel(255, 255, 255);
  for (uint32_t i = 0; i < 8; ++i) tile.full.push_back({i << 9, 3});
  EXPECT_EQ(refusal(encode_octree_small(tile)),
            "grid container, small octree: a full node is spelled out");
  tile.full.clear();
  tile.masks[0].words.fill(~uint64_t{0});
  EXPECT_EQ(refusal(encode_octree_small(tile)),
            "grid container, small octree: a full node is spelled out");
}

TEST(OctreeSmall, flipped_and_random_bytes_give_a_tile_or_an_error) {
  std::mt19937 random(4);
  const auto shell = encode_octree_small(test::sphere_shell(30, 2));
  const auto split = encode_octree_small(test::ball(60));
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    auto bytes = round % 3 == 0 ? shell : round % 3 == 1 ? split : std::vector<uint8_t>(100);
    if (round % 3 == 2) {
      for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
      bytes[0] = 0;
    }
    for (int flip = 0; flip < 1 + round % 5; ++flip) {
      bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1u << random() % 8);
    }
    SparseTile tile;
    const Status status = decode_octree_small(bytes, false, tile);
    refused += status ? 0 : 1;
    EXPECT_LE(tile.voxel_count(), size_t{1} << 24);
    EXPECT_EQ(tile.brick_morton.size(), tile.masks.size());
  }
  EXPECT_GT(refused, 40);
}

}  // namespace
}  // namespace voxeld
