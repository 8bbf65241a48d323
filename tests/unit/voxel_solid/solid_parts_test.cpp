// The parts that fills are made of, one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/voxel/solid/distance/brick_planes.h"
#include "server/voxel/solid/distance/distance.h"
#include "server/voxel/solid/inside/boundary.h"
#include "server/voxel/solid/inside/tile_bits.h"
#include "server/voxel/solid/merge.h"
#include "server/voxel/solid/shell.h"

namespace voxeld {
namespace {

TEST(SolidParts, bricks_of_rows_and_planes_have_the_layout_of_tiles) {
  std::mt19937_64 random(1);
  BrickRow rows{};
  for (uint64_t& word : rows) word = random();
  for (const int brick : {0, 7, 19, 31}) {
    const BrickMask mask = brick_of_row(rows, brick);
    size_t wrong = 0;
    for (uint32_t z = 0; z < 8; ++z) {
      for (uint32_t y = 0; y < 8; ++y) {
        for (uint32_t x = 0; x < 8; ++x) {
          const auto at = static_cast<size_t>(brick) * 8 + x;
          const bool expected = (rows[(z * 8 + y) * 4 + at / 64] >> (at % 64) & 1) != 0;
          const uint32_t bit = morton_encode(x, y, z);
          wrong += (mask.words[bit / 64] >> (bit % 64) & 1) != (expected ? 1 : 0);
        }
      }
    }
    EXPECT_EQ(wrong, 0u);
    EXPECT_TRUE(brick_of_planes(planes_of_brick(mask)) == mask);
  }
}

TEST(SolidParts, a_closed_mesh_has_no_boundary_whatever_its_vertices_are_numbered) {
  // A tetrahedron whose faces share no vertices; one face is there twice and once turned around.
  const std::vector<glm::ivec3> p = {{0, 0, 0}, {256, 0, 0}, {0, 256, 0}, {0, 0, 256}};
  const auto face = [&](int a, int b, int c) {
    return std::vector<glm::ivec3>{p[static_cast<size_t>(a)], p[static_cast<size_t>(b)],
                                   p[static_cast<size_t>(c)]};
  };
  std::vector<glm::ivec3> corners;
  for (const auto& one :
       {face(0, 2, 1), face(0, 1, 3), face(1, 2, 3), face(2, 0, 3), face(0, 2, 1), face(1, 2, 0)}) {
    corners.insert(corners.end(), one.begin(), one.end());
  }
  EXPECT_TRUE(boundary_edges(FillMesh::of(corners, 8)).empty());
  corners.resize(9);  // without the last face
  const auto boundary = boundary_edges(FillMesh::of(corners, 8));
  EXPECT_EQ(boundary.size(), 3u);
  const auto cones = closing_cones(boundary);
  EXPECT_EQ(cones.size(), 9u);
  corners.insert(corners.end(), cones.begin(), cones.end());
  EXPECT_TRUE(boundary_edges(FillMesh::of(corners, 8)).empty());
}

TEST(SolidParts, a_mesh_takes_memory_of_its_own_only_where_the_surface_has_not_all_triangles) {
  Scene scene;
  MeshPart& part = scene.parts.emplace_back();
  part.positions = {{1, 1, 1}, {7, 1, 1}, {1, 7, 1}, {1, 1, 20}};
  part.indices = {0, 1, 2, 0, 1, 3};
  const auto own_bytes = [&](int cells_z) {
    GridSpec spec;
    spec.dims = {8, 8, cells_z};
    const auto mesh = snap_scene(scene, glm::dmat4(1.0), spec);
    EXPECT_TRUE(mesh.ok());
    const FillMesh fill = FillMesh::of(scene, glm::dmat4(1.0), spec, *mesh);
    EXPECT_EQ(fill.triangle_count(), 2u);
    return FillMesh::own_bytes(scene, *mesh);
  };
  EXPECT_EQ(own_bytes(24), 0);
  EXPECT_EQ(own_bytes(8), 4 * 12 + 2 * 12);
}

TEST(SolidParts, distances_are_exact) {
  std::mt19937 random(3);
  for (int round = 0; round < 20; ++round) {
    DistanceBox box;
    box.size = glm::ivec3(9 + round, 12, 10 + round % 3);
    box.first = glm::ivec3(1, 3, 2);
    box.side = 6;
    std::vector<glm::ivec3> set;
    for (int i = 0; i < round; ++i) {
      set.emplace_back(random() % static_cast<unsigned>(box.size.x), random() % 12,
                       random() % static_cast<unsigned>(box.size.z));
    }
    DistanceScratch scratch;
    std::vector<uint32_t> distances;
    squared_distances(
        box,
        [&](int y, int z, std::span<uint8_t> row) {
          std::ranges::fill(row, uint8_t{0});
          for (const glm::ivec3& at : set) {
            if (at.y == y && at.z == z) row[static_cast<size_t>(at.x)] = 1;
          }
        },
        scratch, distances);
    size_t wrong = 0, i = 0;
    for (int z = 2; z < 8; ++z) {
      for (int y = 3; y < 9; ++y) {
        for (int x = 1; x < 7; ++x, ++i) {
          uint32_t least = kNoDistance;
          for (const glm::ivec3& at : set) {
            const glm::ivec3 d = at - glm::ivec3(x, y, z);
            least = std::min(least, static_cast<uint32_t>(d.x * d.x + d.y * d.y + d.z * d.z));
          }
          wrong += distances[i] != least;
        }
      }
    }
    EXPECT_EQ(wrong, 0u) << round;
  }
}

TEST(SolidParts, thicknesses_are_compared_without_rounding) {
  EXPECT_EQ(squared_limit(1.0), 1);
  EXPECT_EQ(squared_limit(256.0), 65536);
  // The double next to the root of 2 is above it, and its square is above 2; that of 3 is below.
  EXPECT_EQ(squared_limit(std::sqrt(2.0)), 2);
  EXPECT_EQ(squared_limit(std::nextafter(std::sqrt(2.0), 0.0)), 1);
  EXPECT_EQ(squared_limit(std::sqrt(3.0)), 2);
  EXPECT_EQ(squared_limit(std::nextafter(16.0, 0.0)), 255);
}

TEST(SolidParts, full_nodes_are_split_by_surface_with_attributes_alone) {
  SparseTile inside, surface;
  inside.full.push_back({0, 2});
  surface.brick_morton = {3, 100};
  surface.masks.resize(2);
  surface.masks[0].words[0] = 5;
  surface.masks[1].words[7] = 1;
  const SparseTile bare = merge_tile(surface, inside, {});
  EXPECT_EQ(bare.full, inside.full);
  EXPECT_EQ(bare.brick_morton, std::vector<uint32_t>{100});
  surface.color.assign(12, 9);
  const SparseTile colored = merge_tile(surface, inside, {.color = true});
  EXPECT_EQ(colored.voxel_count(), 64u * 512 + 1);
  EXPECT_EQ(colored.attribute_count(), 513u);
  ASSERT_EQ(colored.color.size(), 4u * 513);
  EXPECT_EQ(std::vector<uint8_t>(colored.color.begin(), colored.color.begin() + 12),
            (std::vector<uint8_t>{9, 9, 9, 9, 0, 0, 0, 0, 9, 9, 9, 9}));
  EXPECT_EQ(colored.full.size(), 7u + 7u);
}

}  // namespace
}  // namespace voxeld
