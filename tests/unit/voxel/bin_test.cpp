#include "server/voxel/triangles/bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "proto/codec/sparse_tile.h"

namespace voxeld {
namespace {

struct TileBox {
  glm::ivec3 first, last;
};

// A triangle whose corners lie in tiles `first` to `last`, two of them in the outermost ones.
void add_triangle(std::mt19937_64& random, const TileBox& box, SnappedMesh& mesh) {
  const auto count = static_cast<uint32_t>(mesh.vertices.size());
  constexpr int kTileQ = limits::kTileSide * kSubVoxelsPerVoxel;
  const auto in_tile = [&](int tile) {
    return tile * kTileQ + static_cast<int>(random() % kTileQ);
  };
  const int turn = static_cast<int>(random() % 3);
  std::array<glm::ivec3, 3> corners{};
  for (int axis = 0; axis < 3; ++axis) {
    const int low = in_tile(box.first[axis]), high = in_tile(box.last[axis]);
    corners[static_cast<size_t>(turn)][axis] = low;
    corners[static_cast<size_t>(turn + 1) % 3][axis] = (low + high) / 2;
    corners[static_cast<size_t>(turn + 2) % 3][axis] = high;
  }
  for (const glm::ivec3& corner : corners) mesh.vertices.push_back(corner);
  mesh.triangles.push_back({{count, count + 1, count + 2}, 0});
}

TEST(TileBins, hold_each_triangle_in_every_tile_of_its_box_in_order) {
  std::mt19937_64 random(1);
  SnappedMesh mesh;
  const glm::ivec3 tile_dims(4, 3, 5);
  std::vector<TileBox> boxes;
  size_t expected = 0, found = 0;
  for (int t = 0; t < 100'000; ++t) {  // enough for several chunks
    TileBox box{};
    size_t tiles = 1;
    for (int c = 0; c < 3; ++c) {
      box.first[c] = static_cast<int>(random() % static_cast<uint32_t>(tile_dims[c]));
      box.last[c] = std::min(box.first[c] + (t % 10 == 0 ? 1 : 0), tile_dims[c] - 1);
      tiles *= static_cast<size_t>(box.last[c] - box.first[c] + 1);
    }
    expected += tiles;
    boxes.push_back(box);
    add_triangle(random, box, mesh);
  }
  const TileBins bins(mesh, tile_dims);
  uint32_t previous = 0;
  for (const TileBin& bin : bins.bins()) {
    found += bin.triangles.size();
    EXPECT_TRUE(std::is_sorted(bin.triangles.begin(), bin.triangles.end()));
    for (const uint32_t t : bin.triangles) {
      for (int c = 0; c < 3; ++c) {
        ASSERT_GE(bin.coord[c], boxes[t].first[c]);
        ASSERT_LE(bin.coord[c], boxes[t].last[c]);
      }
    }
    const uint32_t code =
        morton_encode(static_cast<uint32_t>(bin.coord.x), static_cast<uint32_t>(bin.coord.y),
                      static_cast<uint32_t>(bin.coord.z));
    EXPECT_TRUE(&bin == bins.bins().data() || code > previous);
    previous = code;
  }
  EXPECT_EQ(found, expected);
  EXPECT_EQ(bins.bins().size(), 60u);
}

TEST(TileBins, keep_triangles_that_reach_out_of_the_grid_in_its_outermost_tiles) {
  SnappedMesh mesh;
  mesh.vertices = {{-256, 5, 5}, {5, -256, 5}, {600 * 256, 5, 301 * 256}};
  mesh.triangles.push_back({{0, 1, 2}, 0});
  const TileBins bins(mesh, {2, 1, 1});
  ASSERT_EQ(bins.bins().size(), 2u);
  EXPECT_EQ(bins.bins()[0].coord, glm::ivec3(0, 0, 0));
  EXPECT_EQ(bins.bins()[1].coord, glm::ivec3(1, 0, 0));
}

TEST(TileBins, an_empty_mesh_has_no_bins) {
  EXPECT_TRUE(TileBins(SnappedMesh(), {1, 1, 1}).bins().empty());
  EXPECT_TRUE(TileBins(SnappedMesh(), {2, 2, 2}).bins().empty());
}

}  // namespace
}  // namespace voxeld
