// The octrees that the device builds are those that the CPU makes of the same tiles, byte by byte.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "proto/codec/octree_codec.h"
#include "server/voxel/gl/occupancy/batch_octree.h"
#include "server/voxel/tiles/tile_mask.h"
#include "shaders/shared/voxelize_batch.h"
#include "tests/gpu/voxel/pipelines.h"

namespace voxeld::pipelines {
namespace {

class DeviceOctree {
 public:
  // Compares the octrees of a grid's tiles, at most BATCH_SLOTS_MAX at a time.
  void expect_equal(const std::vector<SparseTile>& tiles, bool has_attributes) {
    for (size_t first = 0; first < tiles.size(); first += BATCH_SLOTS_MAX) {
      const size_t count = std::min<size_t>(tiles.size() - first, BATCH_SLOTS_MAX);
      expect_batch({tiles.data() + first, count}, has_attributes);
    }
  }

 private:
  void expect_batch(std::span<const SparseTile> tiles, bool has_attributes) {
    const auto& context = gpu::test_context();
    auto masks = gpu::Buffer::create(context, tiles.size() * kTileMaskBytes, "masks");
    ASSERT_TRUE(masks.ok()) << masks.error().message();
    std::vector<uint64_t> words(kTileMaskBytes / 8);
    for (size_t slot = 0; slot < tiles.size(); ++slot) {
      std::ranges::fill(words, 0u);
      for_each_brick(tiles[slot], [&](uint32_t morton, const BrickMask& mask, size_t) {
        std::ranges::copy(mask.words, words.begin() + std::ptrdiff_t{8} * morton);
      });
      masks->upload(slot * kTileMaskBytes, std::span<const uint64_t>(words));
    }
    gpu::PassTimer timer(context);
    const auto octrees = octree_.run(*masks, tiles.size(), has_attributes, timer);
    ASSERT_TRUE(octrees.ok()) << octrees.error().message();
    for (size_t slot = 0; slot < tiles.size(); ++slot) {
      std::vector<uint8_t> expected;
      if (!tiles[slot].empty()) expected = octree_from_tile(tiles[slot]);
      EXPECT_TRUE((*octrees)[slot] == expected)
          << "tile " << slot << ": " << (*octrees)[slot].size() << " and " << expected.size();
    }
  }

  BatchOctree octree_{gpu::test_context(), shared_shaders()};
};

TEST(DeviceOctrees, equal_those_of_the_cpu_for_surfaces) {
  DeviceOctree octree;
  for (const double size_max : {4.0, 400.0}) {
    const Scene scene = soup(71, {.count = 600, .extent = 600, .size_max = size_max});
    VoxelizeOptions options = unit_cells({600, 600, 600});
    options.color = ColorMode::kNone;
    const Grid grid = voxelize(scene, options, PipelineChoice::kCpu);
    EXPECT_GT(grid.tiles.size(), 20u);
    octree.expect_equal(grid.tiles, false);
  }
}

TEST(DeviceOctrees, equal_those_of_the_cpu_for_voxels_with_attributes) {
  const Scene scene = soup(72, {.count = 2000, .extent = 100, .size_max = 30, .colors = true});
  const Grid grid = voxelize(scene, unit_cells({100, 100, 100}), PipelineChoice::kCpu);
  ASSERT_TRUE(grid.channels.color);
  DeviceOctree().expect_equal(grid.tiles, true);
}

TEST(DeviceOctrees, full_nodes_of_every_level_have_no_children) {
  // Cubes of 8 to 256 cells, some side by side, so that eight make a larger one.
  std::vector<SparseTile> tiles;
  for (uint32_t level = 0; level <= kTileLevels; ++level) {
    SparseTile tile;
    tile.full.push_back({0, level});
    const uint32_t next = tile.full[0].brick_count();
    if (level < kTileLevels) {
      tile.brick_morton.push_back(next);
      tile.masks.emplace_back().words[3] = 0x8001'0000'0000'0100u;
      tile.brick_morton.push_back(BATCH_TILE_BRICKS - 1);
      tile.masks.emplace_back().words[7] = uint64_t{1} << 63;
    }
    tiles.push_back(tile);
  }
  tiles.emplace_back();
  DeviceOctree().expect_equal(tiles, false);
}

TEST(DeviceOctrees, equal_those_of_the_cpu_for_random_masks_of_every_density) {
  std::mt19937_64 random(73);
  std::vector<SparseTile> tiles;
  for (const uint64_t one_in : {1u, 2u, 7u, 300u, 20'000u}) {
    SparseTile tile;
    for (uint32_t brick = 0; brick < BATCH_TILE_BRICKS; ++brick) {
      if (random() % one_in != 0) continue;
      BrickMask mask;
      // Full, half full, or a voxel or two.
      for (uint64_t& word : mask.words) {
        word = brick % 3 == 0   ? ~uint64_t{0}
               : brick % 3 == 1 ? random()
                                : random() & random() >> 40;
      }
      mask.words[0] |= 1;
      tile.brick_morton.push_back(brick);
      tile.masks.push_back(mask);
    }
    canonicalize(tile);
    tiles.push_back(std::move(tile));
  }
  DeviceOctree().expect_equal(tiles, false);
}

}  // namespace
}  // namespace voxeld::pipelines
