// Work items: they cover what triangles touch, and stay below the loop limit.
#include "server/voxel/triangles/tile_window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "proto/codec/sparse_tile.h"
#include "shaders/shared/voxelize.h"
#include "tests/reference/touch_oracle.h"

namespace voxeld {
namespace {

struct Item {
  size_t triangle;
  int axis, i0, j0, i1, j1;
};

Item unpacked(const WorkItemWords& words) {
  const auto bits = [&](int shift, uint32_t mask) {
    return static_cast<int>(words.columns >> shift & mask);
  };
  Item item{words.triangle,
            bits(VOXELIZE_ITEM_AXIS_SHIFT, 3),
            bits(0, 255),
            bits(VOXELIZE_ITEM_J_SHIFT, 255),
            0,
            0};
  item.i1 = item.i0 + bits(VOXELIZE_ITEM_NI_SHIFT, 15);
  item.j1 = item.j0 + bits(VOXELIZE_ITEM_NJ_SHIFT, 15);
  return item;
}

// A mesh of random triangles in a grid of 600 cells, a third of them without area.
Scene random_scene(uint64_t seed, int count) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Scene scene;
  MeshPart part;
  for (int t = 0; t < count; ++t) {
    const double size = std::pow(2.0, 10 * uniform(random) - 2);
    const glm::dvec3 centre(600 * uniform(random), 600 * uniform(random), 600 * uniform(random));
    for (int i = 0; i < 3; ++i) {
      glm::dvec3 p = centre;
      for (int c = 0; c < 3; ++c) {
        p[c] = std::clamp(centre[c] + size * (uniform(random) - 0.5), 0.0, 600.0);
      }
      if (t % 3 == 0 && i == 2) p = part.positions.back();
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back(p);
    }
  }
  scene.parts.push_back(std::move(part));
  return scene;
}

class TileWindowTest : public ::testing::Test {
 protected:
  void fill(const glm::ivec3& coord, int block_columns) {
    spec_.dims = glm::ivec3(600);
    auto mesh = snap_scene(random_scene(1, 300), glm::dmat4(1.0), spec_);
    ASSERT_TRUE(mesh.ok());
    mesh_ = std::move(mesh).value();
    const TileBins bins(mesh_, spec_.tile_dims());
    const std::vector<int> images = {-1};
    for (const TileBin& bin : bins.bins()) {
      if (bin.coord != coord) continue;
      ids_.assign(bin.triangles.begin(), bin.triangles.end());
      ASSERT_TRUE(fill_tile_window(mesh_, spec_, coord, ids_, images, {block_columns}, window_));
    }
    coord_ = coord;
  }
  std::array<std::array<int64_t, 3>, 3> doubled(size_t triangle) const {
    std::array<std::array<int64_t, 3>, 3> v{};
    for (size_t i = 0; i < 9; ++i) {
      v[i / 3][i % 3] = 2 * int64_t{window_.vertices[9 * triangle + i]} + 1;
    }
    return v;
  }

  GridSpec spec_;
  SnappedMesh mesh_;
  std::vector<uint32_t> ids_;
  TileWindow window_;
  glm::ivec3 coord_{0};
};

TEST_F(TileWindowTest, items_and_blocks_cover_every_touched_cell_once) {
  fill({1, 0, 2}, 16);
  const glm::ivec3 cell_max = tile_cell_max(spec_, coord_);
  EXPECT_EQ(cell_max, glm::ivec3(255, 255, 87));
  size_t touched = 0;
  std::mt19937_64 random(2);
  for (size_t t = 0; t < window_.triangle_count(); ++t) {
    const auto v = doubled(t);
    std::vector<Item> items;
    for (const WorkItemWords& words : window_.items) {
      if (words.triangle == t) items.push_back(unpacked(words));
    }
    for (int n = 0; n < 4000; ++n) {
      // A cell near a random point of the triangle.
      const double a = double(random() % 1000) / 1000, b = double(random() % 1000) / 1000 * (1 - a);
      std::array<int, 3> cell{};
      for (size_t c = 0; c < 3; ++c) {
        const double p =
            (double(v[0][c]) * (1 - a - b) + double(v[1][c]) * a + double(v[2][c]) * b) / 512;
        cell[c] = static_cast<int>(std::floor(p)) + static_cast<int>(random() % 3) - 1;
      }
      if (cell[0] < 0 || cell[1] < 0 || cell[2] < 0 || cell[0] > cell_max.x ||
          cell[1] > cell_max.y || cell[2] > cell_max.z || !reference::touches(v, cell)) {
        continue;
      }
      ++touched;
      const auto axis = static_cast<size_t>(window_.axes[t]);
      const int i = cell[(axis + 1) % 3], j = cell[(axis + 2) % 3];
      int covered = 0;
      for (const Item& item : items) {
        EXPECT_EQ(item.axis, window_.axes[t]);
        covered += item.i0 <= i && i <= item.i1 && item.j0 <= j && j <= item.j1;
      }
      ASSERT_EQ(covered, 1);
      const uint32_t block =
          morton_encode(static_cast<uint32_t>(cell[0] / 64), static_cast<uint32_t>(cell[1] / 64),
                        static_cast<uint32_t>(cell[2] / 64));
      ASSERT_NE(window_.blocks >> block & 1, 0u);
    }
  }
  EXPECT_GT(touched, 1000u);
}

TEST_F(TileWindowTest, no_item_comes_near_the_loop_limit) {
  for (const int block_columns : {4, 16}) {
    fill({0, 0, 0}, block_columns);
    ASSERT_FALSE(window_.items.empty());
    for (const WorkItemWords& words : window_.items) {
      const Item item = unpacked(words);
      const int columns = (item.i1 - item.i0 + 1) * (item.j1 - item.j0 + 1);
      const auto v = doubled(item.triangle);
      std::array<int64_t, 3> d{}, e{};
      for (size_t c = 0; c < 3; ++c) {
        d[c] = v[1][c] - v[0][c];
        e[c] = v[2][c] - v[0][c];
      }
      const bool has_area =
          d[1] * e[2] != d[2] * e[1] || d[2] * e[0] != d[0] * e[2] || d[0] * e[1] != d[1] * e[0];
      // Each column is one iteration, and one more per cell.
      EXPECT_LT(columns * (has_area ? 6 : 257) + 16, 65'535 / 2);
    }
  }
}

TEST_F(TileWindowTest, items_are_sorted_into_ranges_of_one_class) {
  fill({0, 0, 0}, 16);
  size_t at = 0;
  int previous = -1;
  for (const ItemRange& range : window_.ranges) {
    EXPECT_EQ(range.first, at);
    EXPECT_GT(range.count, 0u);
    EXPECT_GT(static_cast<int>(range.touch_class), previous);
    previous = static_cast<int>(range.touch_class);
    at += range.count;
  }
  EXPECT_EQ(at, window_.items.size());
  EXPECT_EQ(window_.ranges.size(), kTouchClassCount);
}

TEST(CornerOrder, is_ascending_and_knows_orientation) {
  const glm::ivec3 a(0, 0, 0), b(0, 0, 1), c(0, 1, 0);
  const auto order = [](const glm::ivec3& x, const glm::ivec3& y, const glm::ivec3& z) {
    return corner_order({x, y, z});
  };
  using Corners = std::array<uint8_t, 3>;
  EXPECT_EQ(order(a, b, c).corner, (Corners{0, 1, 2}));
  EXPECT_FALSE(order(a, b, c).reversed);
  EXPECT_EQ(order(b, c, a).corner, (Corners{2, 0, 1}));
  EXPECT_FALSE(order(b, c, a).reversed);
  EXPECT_EQ(order(c, b, a).corner, (Corners{2, 1, 0}));
  EXPECT_TRUE(order(c, b, a).reversed);
  EXPECT_TRUE(order(a, c, b).reversed);
  EXPECT_EQ(order(a, a, a).corner, (Corners{0, 1, 2}));
}

}  // namespace
}  // namespace voxeld
