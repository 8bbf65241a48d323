#include "server/voxel/attributes/resolve.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

constexpr AttributeChannels kAll = {true, true, true};

SparseTile tile_for(size_t voxels) {
  SparseTile tile;
  tile.color.resize(4 * voxels);
  tile.normal.resize(3 * voxels);
  return tile;
}

TEST(Resolve, rounds_means_and_writes_after_the_first_voxel) {
  // weight, r, g, b, a, x, y, z: +x, half opaque; of what is seen, half red and all blue.
  const std::vector<uint32_t> sums = {2, 32768, 0, 65535, 65535, 131070, 65536, 65536};
  SparseTile tile = tile_for(2);
  resolve_voxels(sums, {}, {kAll, false, {.color = true, .normal = true}}, 1, tile);
  EXPECT_EQ(tile.color, (std::vector<uint8_t>{0, 0, 0, 0, 188, 0, 255, 128}));
  EXPECT_EQ(tile.normal, (std::vector<int8_t>{0, 0, 0, 127, 0, 0}));
}

TEST(Resolve, carries_are_the_upper_halves) {
  // 2^33 of weight, all of it 65535: 65535 * 2^33 = 0x1fffe * 2^32.
  const uint32_t high = 0x1fffe;
  const std::vector<uint32_t> sums(8, 0u);
  const std::vector<uint32_t> carries = {2, high, high, high, high, high, 0x10000, 0x10000};
  SparseTile tile = tile_for(1);
  resolve_voxels(sums, carries, {kAll, false, {.color = true, .normal = true}}, 0, tile);
  EXPECT_EQ(tile.color, (std::vector<uint8_t>{255, 255, 255, 255}));
  EXPECT_EQ(tile.normal, (std::vector<int8_t>{127, 0, 0}));
}

TEST(Resolve, normals_that_cancel_are_zero) {
  const std::vector<uint32_t> sums = {2, 0, 0, 0, 0, 65535 + 1, 65536, 65536};
  SparseTile tile = tile_for(1);
  resolve_voxels(sums, {}, {kAll, false, {.color = true, .normal = true}}, 0, tile);
  EXPECT_EQ(tile.normal, (std::vector<int8_t>{0, 0, 0}));
}

TEST(Resolve, what_is_not_seen_is_white) {
  const std::vector<uint32_t> sums = {4, 0, 0, 0, 0, 4, 1, 0, 0, 4 * 128};
  SparseTile tile = tile_for(2);
  resolve_voxels(sums, {}, {{true, true, false}, false, {.color = true}}, 0, tile);
  EXPECT_EQ(tile.color, (std::vector<uint8_t>{255, 255, 255, 0, 255, 255, 255, 0}));
}

TEST(Resolve, without_alpha_voxels_are_opaque) {
  const std::vector<uint32_t> sums = {4, 4 * 65535, 0, 0};
  SparseTile tile = tile_for(1);
  resolve_voxels(sums, {}, {{true, false, false}, false, {.color = true}}, 0, tile);
  EXPECT_EQ(tile.color, (std::vector<uint8_t>{255, 0, 0, 255}));
}

TEST(Resolve, faces_away_from_the_light_keep_ambient_light_alone) {
  // White, -y: linear 0.2 is sRGB 124.
  const std::vector<uint32_t> sums = {1, 65535, 65535, 65535, 32768, 1, 32768};
  SparseTile tile = tile_for(1);
  resolve_voxels(sums, {}, {{true, false, true}, true, {.color = true}}, 0, tile);
  EXPECT_EQ(tile.color, (std::vector<uint8_t>{124, 124, 124, 255}));
}

}  // namespace
}  // namespace voxeld
