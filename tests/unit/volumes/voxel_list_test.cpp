#include "server/volumes/voxel_list.h"

#include <gtest/gtest.h>

#include <atomic>

#include "server/base/cancel_point.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld::volumes {
namespace {

constexpr ChannelSet kAllChannels = {.color = true,
                                     .normal = true,
                                     .material = true,
                                     .label = true,
                                     .distance = true,
                                     .coverage = true};

VoxelValues values_of_test_voxel(const test::TestVoxel& voxel) {
  return {voxel.color, voxel.normal, voxel.material, voxel.label, voxel.distance, voxel.coverage};
}

VoxelList list_of(const std::vector<test::TestVoxel>& voxels) {
  VoxelList list;
  for (const test::TestVoxel& voxel : voxels) {
    list.add({voxel.cell[0], voxel.cell[1], voxel.cell[2]},
             list.add_values(values_of_test_voxel(voxel)));
  }
  return list;
}

// tiles_of() keeps the first of several voxels in a cell, too.
TEST(VoxelList, voxels_in_any_order_become_sorted_tiles_with_their_values) {
  for (const int count : {1, 50, 3000, 40000}) {
    std::mt19937 random(static_cast<uint32_t>(count));
    const std::array<int, 3> dims = {700, 300, 16384};
    const auto voxels = test::random_voxels(random, dims, count);
    Grid grid = test::grid_of(dims, voxels, kAllChannels);
    VoxelList list = list_of(voxels);
    EXPECT_EQ(list.size(), voxels.size());
    EXPECT_TRUE(list.finish(kAllChannels) == grid.tiles) << count;
    EXPECT_EQ(list.size(), 0u);
    EXPECT_TRUE(list.finish(kAllChannels).empty());
  }
}

TEST(VoxelList, of_voxels_in_a_cell_the_first_stays_at_any_number_of_voxels) {
  for (const int side : {3, 20}) {  // below and above the least number for a radix sort
    VoxelList list;
    for (int i = 0; i < 4; ++i) {
      VoxelValues of_layer;
      of_layer.label = static_cast<uint16_t>(1 + i);
      const uint32_t values = list.add_values(of_layer);
      for (int k = 0; k < side * side * side; ++k) {
        list.add({k % side, 250 + k / side % side, k / side / side}, values);
      }
    }
    uint64_t count = 0;
    for (const SparseTile& tile : list.finish({.label = true})) {
      EXPECT_EQ(tile.label.size(), tile.voxel_count());
      for (const uint16_t label : tile.label) EXPECT_EQ(label, 1);
      count += tile.voxel_count();
    }
    EXPECT_EQ(count, static_cast<uint64_t>(side * side * side));
  }
}

TEST(VoxelList, full_bricks_without_values_become_full_nodes) {
  VoxelList list;
  const uint32_t none = list.add_values({});
  for (const auto& voxel : test::box_voxels({16368, 16, 16}, {16384, 32, 32})) {
    list.add({voxel.cell[0], voxel.cell[1], voxel.cell[2]}, none);
  }
  const auto tiles = list.finish({});
  ASSERT_EQ(tiles.size(), 1u);
  EXPECT_TRUE(tiles[0].masks.empty());
  ASSERT_EQ(tiles[0].full.size(), 1u);
  EXPECT_EQ(tiles[0].full[0].level, 1u);
  EXPECT_EQ(tiles[0].coord, (std::array<int32_t, 3>{63, 0, 0}));
}

TEST(VoxelList, finishing_stops_when_it_is_cancelled) {
  std::mt19937 random(1);
  VoxelList list = list_of(test::random_voxels(random, {50, 50, 50}, 500));
  const std::atomic<bool> cancelled = true;
  const CancelScope scope(cancelled);
  EXPECT_THROW(static_cast<void>(list.finish({})), Cancelled);
}

}  // namespace
}  // namespace voxeld::volumes
