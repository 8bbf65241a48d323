// Models made of the faces of voxels come back as those voxels, with their colours: fill=solid,
// rule=none.
#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "tests/unit/voxel_solid/solid_scenes.h"

namespace voxeld {
namespace {

using namespace solid_test;

constexpr int kSide = 9;

// Cells at random, each of one of seven colours; 0: empty.
std::vector<int> random_model(unsigned seed) {
  std::mt19937 random(seed);
  std::vector<int> cells(static_cast<size_t>(kSide * kSide * kSide));
  for (int& cell : cells) cell = random() % 3 == 0 ? static_cast<int>(1 + random() % 7) : 0;
  return cells;
}

int cell_at(const std::vector<int>& cells, const glm::ivec3& at) {
  for (int axis = 0; axis < 3; ++axis) {
    if (at[axis] < 0 || at[axis] >= kSide) return 0;
  }
  return cells[static_cast<size_t>((at.z * kSide + at.y) * kSide + at.x)];
}

// A square for each face between a cell and an empty one, wound outwards, of `size` a side.
Scene faces_of(const std::vector<int>& cells, double size, const glm::dvec3& origin) {
  Scene scene;
  MeshPart part;
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const glm::ivec3 at(i % kSide, i / kSide % kSide, i / kSide / kSide);
    const int color = cell_at(cells, at);
    for (int d = 0; color != 0 && d < 6; ++d) {
      const int axis = d / 2, u = (axis + 1) % 3, v = (axis + 2) % 3, step = d % 2;
      glm::ivec3 next = at;
      next[axis] += 2 * step - 1;
      if (cell_at(cells, next) != 0) continue;
      const auto first = static_cast<uint32_t>(part.positions.size());
      for (const glm::ivec2& corner : {glm::ivec2(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
        glm::ivec3 place = at;
        place[axis] += step;
        place[u] += corner.x;
        place[v] += corner.y;
        part.positions.push_back(origin + size * glm::dvec3(place));
        part.colors.emplace_back(color & 1, color >> 1 & 1, color >> 2, 1);
      }
      for (const uint32_t corner : {0u, 1u, 2u, 0u, 2u, 3u}) {
        part.indices.push_back(first + (step == 1 ? corner : 3 - corner));
      }
    }
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

void expect_model(const Grid& grid, const std::vector<int>& cells, const std::string& what) {
  ASSERT_EQ(grid.spec.dims, glm::ivec3(kSide)) << what;
  size_t voxels = 0;
  for (const SparseTile& tile : grid.tiles) {
    ASSERT_TRUE(tile.full.empty()) << what;
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      ++voxels;
      const int color = cell_at(cells, {x, y, z});
      EXPECT_NE(color, 0) << what << " " << x << " " << y << " " << z;
      bool has_face = false;
      for (int d = 0; d < 6; ++d) {
        glm::ivec3 next(x, y, z);
        next[d / 2] += 2 * (d % 2) - 1;
        has_face |= cell_at(cells, next) == 0;
      }
      if (!has_face) return;
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(tile.color[4 * voxel + static_cast<size_t>(c)], (color >> c & 1) * 255)
            << what << " " << x << " " << y << " " << z;
      }
    });
  }
  EXPECT_EQ(voxels, static_cast<size_t>(std::ranges::count_if(cells, [](int c) { return c > 0; })))
      << what;
}

VoxelizeOptions request(double size, const glm::dvec3& origin) {
  VoxelizeOptions options = solid(Sign::kAuto);
  set_bounds(options, origin, origin + glm::dvec3(size * kSide));
  options.placement.voxel_size.reset();
  options.placement.dims = {kSide, kSide, kSide};
  options.color = ColorMode::kNearest;
  return options;
}

TEST(VoxelModel, comes_back_with_its_cells_and_colors) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    std::vector<int> cells = random_model(seed);
    // The mesh reaches every side.
    for (const int corner : {0, kSide * kSide * kSide - 1}) cells[static_cast<size_t>(corner)] = 7;
    for (const double size : {1.0, 0.1, 1.0 / 3}) {
      const glm::dvec3 origin(0.7 * seed, -3.3, 12);
      const Scene scene = faces_of(cells, size, origin);
      expect_model(voxelized(scene, request(size, origin)), cells,
                   "seed " + std::to_string(seed) + ", size " + std::to_string(size));
    }
  }
}

TEST(VoxelModel, may_be_mirrored) {
  const std::vector<int> cells = [] {
    std::vector<int> all = random_model(4);
    for (const int corner : {0, kSide * kSide * kSide - 1}) all[static_cast<size_t>(corner)] = 7;
    return all;
  }();
  std::vector<int> mirrored(cells.size());
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const glm::ivec3 at(i % kSide, i / kSide % kSide, i / kSide / kSide);
    mirrored[static_cast<size_t>(i)] = cell_at(cells, {kSide - 1 - at.x, at.y, at.z});
  }
  VoxelizeOptions options = request(1, glm::dvec3(0));
  options.placement.transform = {-1, 0, 0, kSide, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  expect_model(voxelized(faces_of(cells, 1, glm::dvec3(0)), options), mirrored, "mirrored");
}

}  // namespace
}  // namespace voxeld
