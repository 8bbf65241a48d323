#include "server/voxel/bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "proto/sparse_tile.h"

namespace voxeld {
namespace {

TEST(TileBins, hold_each_triangle_in_every_tile_of_its_box_in_order) {
  std::mt19937_64 random(1);
  SnappedMesh mesh;
  const glm::ivec3 tile_dims(4, 3, 5);
  for (int t = 0; t < 100'000; ++t) {  // enough for several chunks
    TileSpan span;
    for (size_t c = 0; c < 3; ++c) {
      const auto tiles = static_cast<uint32_t>(tile_dims[static_cast<int>(c)]);
      span.first[c] = static_cast<uint32_t>(random() % tiles);
      span.last[c] = std::min(span.first[c] + (t % 10 == 0 ? 1u : 0u), tiles - 1);
    }
    mesh.triangles.push_back({{}, 0, span.packed()});
  }
  const TileBins bins(mesh, tile_dims);
  size_t expected = 0, found = 0;
  for (const SnappedTriangle& triangle : mesh.triangles) {
    const TileSpan span = TileSpan::unpack(triangle.tiles);
    size_t tiles = 1;
    for (size_t c = 0; c < 3; ++c) tiles *= span.last[c] - span.first[c] + 1;
    expected += tiles;
  }
  uint32_t previous = 0;
  for (const TileBin& bin : bins.bins()) {
    found += bin.triangles.size();
    EXPECT_TRUE(std::is_sorted(bin.triangles.begin(), bin.triangles.end()));
    for (const uint32_t t : bin.triangles) {
      const TileSpan span = TileSpan::unpack(mesh.triangles[t].tiles);
      for (size_t c = 0; c < 3; ++c) {
        const auto at = static_cast<uint32_t>(bin.coord[static_cast<int>(c)]);
        ASSERT_GE(at, span.first[c]);
        ASSERT_LE(at, span.last[c]);
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

TEST(TileBins, of_an_empty_mesh_are_none) {
  EXPECT_TRUE(TileBins(SnappedMesh(), {1, 1, 1}).bins().empty());
  EXPECT_TRUE(TileBins(SnappedMesh(), {2, 2, 2}).bins().empty());
}

}  // namespace
}  // namespace voxeld
