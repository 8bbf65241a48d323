#include "server/voxel/tiles/compact.h"

#include <gtest/gtest.h>

#include <random>

#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {
namespace {

TEST(CompactMask, keeps_occupied_bricks_of_the_blocks_in_morton_order) {
  std::vector<uint32_t> mask(kTileMaskWords), offsets(kTileMaskWords, 7);
  const auto set = [&](uint32_t x, uint32_t y, uint32_t z) {
    const uint32_t m = morton_encode(x, y, z);
    mask[m >> 5] |= 1u << (m & 31);
  };
  std::mt19937_64 random(1);
  std::vector<std::array<int32_t, 3>> cells;
  for (int i = 0; i < 500; ++i) {
    const auto x = static_cast<uint32_t>(random() % 64), y = static_cast<uint32_t>(random() % 64),
               z = static_cast<uint32_t>(random() % 64);
    set(x, y, 192 + z);  // block (0, 0, 3)
  }
  set(0, 0, 0);  // left from an earlier tile, in a block that is not listed
  const uint64_t blocks = uint64_t{1} << morton_encode(0, 0, 3);
  SparseTile tile;
  const uint64_t count = compact_mask(mask, blocks, tile, offsets);
  EXPECT_EQ(count, tile.voxel_count());
  EXPECT_TRUE(std::is_sorted(tile.brick_morton.begin(), tile.brick_morton.end()));
  size_t seen = 0;
  for_each_voxel(tile, [&](int x, int y, int z, size_t index) {
    const uint32_t m =
        morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    ASSERT_NE(mask[m >> 5] >> (m & 31) & 1, 0u);
    const uint32_t below = mask[m >> 5] & ((1u << (m & 31)) - 1);
    // The index that the attribute pass computes.
    ASSERT_EQ(offsets[m >> 5] + static_cast<uint32_t>(__builtin_popcount(below)), index);
    ++seen;
  });
  EXPECT_EQ(seen, count);
}

TEST(BlockRuns, join_neighbours) {
  std::vector<std::pair<size_t, size_t>> runs;
  for_each_block_run(0x8000000000000007u, [&](size_t first, size_t count) {
    runs.emplace_back(first / kBlockMaskWords, count / kBlockMaskWords);
  });
  EXPECT_EQ(runs, (std::vector<std::pair<size_t, size_t>>{{0, 3}, {63, 1}}));
}

}  // namespace
}  // namespace voxeld
