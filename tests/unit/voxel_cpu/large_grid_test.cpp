// Occupancy in grids of up to 16384 cells a side, where long triangles are split.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <random>
#include <set>
#include <vector>

#include "server/voxel/cpu/touch_tile.h"
#include "tests/reference/touch_oracle.h"

namespace voxeld {
namespace {

constexpr int kLargeSide = 16384;
using Cells = std::set<std::array<int, 3>>;

GridSpec large_grid() {
  GridSpec spec;
  spec.dims = glm::ivec3(kLargeSide);
  return spec;
}

SnappedMesh snapped(const std::vector<glm::dvec3>& corners) {
  Scene scene;
  scene.parts.emplace_back();
  scene.parts[0].positions = corners;
  for (uint32_t i = 0; i < corners.size(); ++i) scene.parts[0].indices.push_back(i);
  auto mesh = snap_scene(scene, glm::dmat4(1.0), large_grid());
  EXPECT_TRUE(mesh.ok());
  return std::move(*mesh);
}

// Calls visit(x, y, z) for every touched cell; returns the number of cells.
template <typename Visit>
uint64_t for_each_touched(const SnappedMesh& mesh, const Visit& visit) {
  const GridSpec spec = large_grid();
  CpuTouch touch(2);
  const TileBins bins(mesh, spec.tile_dims());
  uint64_t count = 0;
  for (const TileBin& bin : bins.bins()) {
    SparseTile tile;
    tile.coord = {bin.coord.x, bin.coord.y, bin.coord.z};
    count += touch.run(mesh, spec, bin, tile);
    for_each_voxel(tile, [&](int x, int y, int z, size_t) { visit(x, y, z); });
  }
  return count;
}

Cells expected_cells(const SnappedMesh& mesh) {
  Cells cells;
  for (const SnappedTriangle& triangle : mesh.triangles) {
    std::array<std::array<int64_t, 3>, 3> doubled{};
    glm::ivec3 low(INT32_MAX), high(INT32_MIN);
    for (size_t i = 0; i < 3; ++i) {
      const glm::ivec3& q = mesh.vertices[triangle.vertices[i]];
      for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{q[c]} + 1;
      low = glm::min(low, q);
      high = glm::max(high, q);
    }
    low = glm::max((low >> 8) - 1, glm::ivec3(0));
    high = glm::min((high >> 8) + 1, glm::ivec3(kLargeSide - 1));
    for (int z = low.z; z <= high.z; ++z) {
      for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
          if (reference::touches(doubled, {x, y, z})) cells.insert({x, y, z});
        }
      }
    }
  }
  return cells;
}

TEST(LargeGrid, small_triangles_everywhere_agree_with_the_oracle) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> place(0, kLargeSide), step(-9, 9);
  std::vector<glm::dvec3> corners;
  for (int t = 0; t < 400; ++t) {
    glm::dvec3 centre(place(random), place(random), place(random));
    if (t % 4 == 0) centre = glm::dvec3(kLargeSide) - centre / 1000.0;
    for (int i = 0; i < 3; ++i) {
      const glm::dvec3 corner = centre + glm::dvec3(step(random), step(random), step(random));
      corners.push_back(glm::clamp(corner, glm::dvec3(0), glm::dvec3(kLargeSide)));
    }
  }
  const SnappedMesh mesh = snapped(corners);
  Cells cells;
  for_each_touched(mesh, [&](int x, int y, int z) { cells.insert({x, y, z}); });
  EXPECT_GT(cells.size(), 10'000u);
  EXPECT_TRUE(cells == expected_cells(mesh));
}

// Needles as long as the grid, in pieces: the oracle looks at each piece as it was snapped.
TEST(LargeGrid, long_slivers_agree_with_the_oracle_along_all_their_length) {
  const SnappedMesh mesh = snapped({{3, 7, 16380.3},
                                    {16383.9, 90.1, 16000},
                                    {16383.5, 91, 16001.2},
                                    {20.1, 16384, 9},
                                    {21.7, 0, 9.5},
                                    {23, 8000, 7.1}});
  EXPECT_GT(mesh.triangles.size(), 20u);
  Cells cells;
  for_each_touched(mesh, [&](int x, int y, int z) {
    // Only a part of the cells: their neighbours' are like them.
    if (x % 1000 < 40 && y % 1000 < 90) cells.insert({x, y, z});
  });
  Cells expected;
  for (const SnappedTriangle& triangle : mesh.triangles) {
    std::array<std::array<int64_t, 3>, 3> doubled{};
    glm::dvec3 corner[3];
    for (size_t i = 0; i < 3; ++i) {
      const glm::ivec3& q = mesh.vertices[triangle.vertices[i]];
      corner[i] = (glm::dvec3(q) + 0.5) / 256.0;
      for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{q[c]} + 1;
    }
    // Cells around points of the triangle, closer to each other than cells are.
    for (int i = 0; i <= 1600; ++i) {
      for (int j = 0; j <= 2; ++j) {
        const glm::dvec3 along = glm::mix(corner[0], corner[1], i / 1600.0);
        const glm::ivec3 at = glm::ivec3(glm::mix(along, corner[2], j / 2.0));
        for (int n = 0; n < 27; ++n) {
          const std::array<int, 3> cell = {at.x + n % 3 - 1, at.y + n / 3 % 3 - 1,
                                           at.z + n / 9 - 1};
          if (cell[0] % 1000 >= 40 || cell[1] % 1000 >= 90) continue;
          if (*std::min_element(cell.begin(), cell.end()) < 0) continue;
          if (*std::max_element(cell.begin(), cell.end()) >= kLargeSide) continue;
          if (reference::touches(doubled, cell)) expected.insert(cell);
        }
      }
    }
  }
  EXPECT_GT(expected.size(), 500u);
  EXPECT_TRUE(std::ranges::includes(cells, expected));
  for (const auto& cell : cells) {
    const bool is_touched = std::ranges::any_of(mesh.triangles, [&](const SnappedTriangle& t) {
      std::array<std::array<int64_t, 3>, 3> doubled{};
      for (size_t i = 0; i < 3; ++i) {
        const glm::ivec3& q = mesh.vertices[t.vertices[i]];
        for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{q[c]} + 1;
      }
      const auto [low, high] = std::minmax({doubled[0][0], doubled[1][0], doubled[2][0]});
      const bool is_near = low <= 512 * int64_t{cell[0] + 1} && high >= 512 * int64_t{cell[0]};
      return is_near && reference::touches(doubled, cell);
    });
    ASSERT_TRUE(is_touched) << cell[0] << " " << cell[1] << " " << cell[2];
  }
}

TEST(LargeGrid, a_wall_across_the_grid_is_one_layer_without_holes) {
  constexpr int kWall = 5000;
  const SnappedMesh mesh = snapped({{0, 9000.5, 0},
                                    {kWall, 9000.5, 0},
                                    {kWall, 9000.5, kWall},
                                    {0, 9000.5, 0},
                                    {kWall, 9000.5, kWall},
                                    {0, 9000.5, kWall}});
  EXPECT_GT(mesh.triangles.size(), 2u);
  uint64_t outside = 0;
  const uint64_t count = for_each_touched(mesh, [&](int x, int y, int z) {
    // The snapped far side stands half a sub-voxel inside the next cell.
    outside += (y != 9000 || x > kWall || z > kWall) ? 1 : 0;
  });
  EXPECT_EQ(outside, 0u);
  EXPECT_EQ(count, uint64_t{kWall + 1} * (kWall + 1));
}

}  // namespace
}  // namespace voxeld
