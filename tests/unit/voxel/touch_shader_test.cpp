// shaders/lib/touch.glsl, touch_columns.glsl and touch_word.glsl, as C++, against the oracle.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <vector>

#include "shaders/glsl.h"
#include "tests/reference/touch_oracle.h"

namespace voxeld::glsl {

using Visited = std::set<std::array<int, 3>>;

// Cells that the visitor reports; swizzled.
Visited* g_visited = nullptr;

namespace wide {
#include "shaders/lib/touch.glsl"
void begin_column(TouchTriangle, int, int) {}
void visit_cell(int i, int j, int k) {
  g_visited->insert({i, j, k});
}
#include "shaders/lib/touch_columns.glsl"
}  // namespace wide

namespace split {
#undef TOUCH_INT
#undef TOUCH_INT3
#define NO_INT64
#include "shaders/lib/touch.glsl"
void begin_column(TouchTriangle, int, int) {}
void visit_cell(int i, int j, int k) {
  g_visited->insert({i, j, k});
}
#include "shaders/lib/touch_columns.glsl"
#undef NO_INT64
#undef TOUCH_SPLIT
}  // namespace split

namespace narrow {
#undef TOUCH_INT
#undef TOUCH_INT3
#define TOUCH_INT int
#define TOUCH_INT3 ivec3
#include "shaders/lib/touch.glsl"
void begin_column(TouchTriangle, int, int) {}
void visit_cell(int i, int j, int k) {
  g_visited->insert({i, j, k});
}
#include "shaders/lib/touch_columns.glsl"
#include "shaders/lib/touch_word.glsl"
}  // namespace narrow

namespace {

using Triangle = std::array<ivec3, 3>;

struct Block {
  ivec2 first, last;
};

// Each visits the columns of `block` that the triangle's box has.
Visited visited_wide(const Triangle& v, const ivec3& cell_last, const Block& block) {
  Visited cells;
  g_visited = &cells;
  const auto t = wide::touch_setup(v[0], v[1], v[2], cell_last);
  wide::visit_block(t, max(block.first, ivec2(t.cell_min)), min(block.last, ivec2(t.cell_max)));
  return cells;
}
Visited visited_split(const Triangle& v, const ivec3& cell_last, const Block& block) {
  Visited cells;
  g_visited = &cells;
  const auto t = split::touch_setup(v[0], v[1], v[2], cell_last);
  split::visit_block(t, max(block.first, ivec2(t.cell_min)), min(block.last, ivec2(t.cell_max)));
  return cells;
}
Visited visited_narrow(const Triangle& v, const ivec3& cell_last, const Block& block) {
  Visited cells;
  g_visited = &cells;
  const auto t = narrow::touch_setup(v[0], v[1], v[2], cell_last);
  narrow::visit_block(t, max(block.first, ivec2(t.cell_min)), min(block.last, ivec2(t.cell_max)));
  return cells;
}
// Word by word, as voxelize_words does: not swizzled, and in the coordinates of the box's first
// cell.
Visited visited_by_word(const Triangle& v, const ivec3& cell_last) {
  const ivec3 box = min(v[0], min(v[1], v[2])) >> 8, end = max(v[0], max(v[1], v[2])) >> 8;
  const ivec3 origin = box * 256, sides(4, 4, 2);
  const auto t = narrow::touch_setup(v[0] - origin, v[1] - origin, v[2] - origin, cell_last - box);
  const ivec3 first = max(box, ivec3(0)) / sides, last = min(end, cell_last) / sides;
  Visited cells;
  for (int z = first.z; z <= last.z; ++z) {
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        const ivec3 cell = ivec3(x, y, z) * sides;
        const uint bits = narrow::touch_word(t, cell - box);
        for (int b = 0; b < 32; ++b) {
          if ((bits >> b & 1) == 0) continue;
          cells.insert({cell.x + (b & 1) + 2 * (b >> 3 & 1), cell.y + (b >> 1 & 1) + 2 * (b >> 4),
                        cell.z + (b >> 2 & 1)});
        }
      }
    }
  }
  return cells;
}
Visited visited_by_column(const Triangle& v, const ivec3& cell_last, const Block& block) {
  Visited cells;
  g_visited = &cells;
  const auto t = wide::touch_setup(v[0], v[1], v[2], cell_last);
  for (int j = std::max(block.first.y, t.cell_min.y); j <= std::min(block.last.y, t.cell_max.y);
       ++j) {
    for (int i = std::max(block.first.x, t.cell_min.x); i <= std::min(block.last.x, t.cell_max.x);
         ++i) {
      wide::visit_one_column(t, i, j);
    }
  }
  return cells;
}

// The same by the oracle: cells of the block inside the tile.
Visited expected_cells(const Triangle& v, const ivec3& cell_last, const Block& block) {
  std::array<std::array<int64_t, 3>, 3> doubled{};
  ivec3 low(INT32_MAX), high(INT32_MIN);
  for (size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) doubled[i][static_cast<size_t>(c)] = 2 * int64_t{v[i][c]} + 1;
    low = min(low, v[i]);
    high = max(high, v[i]);
  }
  low = max((low >> 8) - 1, ivec3(block.first, 0));
  high = min((high >> 8) + 1, min(cell_last, ivec3(block.last, cell_last.z)));
  Visited cells;
  for (int k = low.z; k <= high.z; ++k) {
    for (int j = low.y; j <= high.y; ++j) {
      for (int i = low.x; i <= high.x; ++i) {
        if (reference::touches(doubled, {i, j, k})) cells.insert({i, j, k});
      }
    }
  }
  return cells;
}

// Corners of triangle number t, `size` wide, near `centre`; every tenth is of one awkward kind.
class Triangles {
 public:
  explicit Triangles(uint64_t seed) : random_(seed) {}
  int integer(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<uint64_t>(high - low + 1));
  }
  Triangle make(int t, ivec3 centre, int size) {
    Triangle v;
    for (ivec3& p : v) {
      for (int c = 0; c < 3; ++c) p[c] = centre[c] + integer(-size / 2, size / 2);
      if (t % 10 == 1) p = (p >> 8) << 8;
      if (t % 10 == 2) p.x = centre.x;
      if (t % 10 == 3) p.y = (centre.y >> 8) * 256 + 255;
    }
    if (t % 10 == 4) v[2] = v[0];
    if (t % 10 == 5) v[1] = v[2] = v[0];
    if (t % 10 == 6) v[2] = v[0] + (v[1] - v[0]) / 3;
    if (t % 10 == 7) v[2] = (v[0] + v[1]) / 2 + ivec3(integer(-3, 3), integer(-3, 3), 0);
    return v;
  }

 private:
  std::mt19937_64 random_;
};

// Swizzled so that the dominant axis is z, as the shaders do.
Triangle turned(const Triangle& v) {
  const int axis = wide::touch_dominant_axis(v[0], v[1], v[2]);
  return {wide::touch_swizzle(v[0], axis), wide::touch_swizzle(v[1], axis),
          wide::touch_swizzle(v[2], axis)};
}

constexpr Block kWholeTile = {{0, 0}, {255, 255}};

TEST(TouchShader, small_triangles_are_exact_in_32_and_in_64_bits_and_in_two_words) {
  Triangles triangles(1);
  const ivec3 cell_last(255, 255, 200);
  for (int t = 0; t < 20'000; ++t) {
    ivec3 centre;
    // Also across the tile's sides.
    for (int c = 0; c < 3; ++c) centre[c] = triangles.integer(-600, 256 * 256 + 600);
    const int size = triangles.integer(1, t % 3 == 0 ? TOUCH_SMALL_EXTENT : 1024);
    const Triangle as_made = triangles.make(t, centre, size);
    ASSERT_EQ(visited_by_word(as_made, cell_last), expected_cells(as_made, cell_last, kWholeTile))
        << "triangle " << t;
    const Triangle v = turned(as_made);
    const Visited expected = expected_cells(v, cell_last, kWholeTile);
    ASSERT_EQ(visited_narrow(v, cell_last, kWholeTile), expected) << "triangle " << t;
    ASSERT_EQ(visited_wide(v, cell_last, kWholeTile), expected) << "triangle " << t;
    ASSERT_EQ(visited_split(v, cell_last, kWholeTile), expected) << "triangle " << t;
    ASSERT_EQ(visited_by_column(v, cell_last, kWholeTile), expected) << "triangle " << t;
  }
}

TEST(TouchShader, the_largest_small_triangles_do_not_overflow) {
  // Corners of the largest box at the far end of the tile: |normal| = 2^24 on all axes.
  const ivec3 cell_last(255);
  for (int mask = 0; mask < 512; ++mask) {
    Triangle v;
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c)
        v[i][c] = 255 * 256 + 255 + ((mask >> (3 * i + c) & 1) * TOUCH_SMALL_EXTENT) -
                  TOUCH_SMALL_EXTENT / 2;
    }
    ASSERT_EQ(visited_by_word(v, cell_last), expected_cells(v, cell_last, kWholeTile)) << mask;
    v = turned(v);
    ASSERT_EQ(visited_narrow(v, cell_last, kWholeTile), expected_cells(v, cell_last, kWholeTile))
        << mask;
  }
}

TEST(TouchShader, triangles_as_large_as_the_largest_grid_are_exact) {
  Triangles triangles(2);
  const ivec3 cell_last(255);
  size_t touched = 0;
  for (int t = 0; t < 400; ++t) {
    // The grid's box in the coordinates of one of its tiles.
    const ivec3 tile(triangles.integer(0, 7), triangles.integer(0, 7), triangles.integer(0, 7));
    const ivec3 box_min = -tile * 65536 - 256, box_max = box_min + 2050 * 256;
    Triangle v = triangles.make(t, ivec3(32768), 2 * 2050 * 256);
    for (ivec3& p : v) p = glm::clamp(p, box_min, box_max);
    v = turned(v);
    const ivec2 first(triangles.integer(0, 247), triangles.integer(0, 247));
    const Block block = {first, first + 8};
    const Visited expected = expected_cells(v, cell_last, block);
    touched += expected.size();
    ASSERT_EQ(visited_wide(v, cell_last, block), expected) << "triangle " << t;
    ASSERT_EQ(visited_split(v, cell_last, block), expected) << "triangle " << t;
    ASSERT_EQ(visited_by_column(v, cell_last, block), expected) << "triangle " << t;
  }
  EXPECT_GT(touched, 1000u);
}

TEST(TouchShader, the_dominant_axis_is_z_before_x_before_y_among_equals) {
  const auto axis = [](ivec3 a, ivec3 b, ivec3 c) { return wide::touch_dominant_axis(a, b, c); };
  const ivec3 o(0), x(512, 0, 0), y(0, 512, 0), z(0, 0, 512);
  EXPECT_EQ(axis(o, x, y), 2);
  EXPECT_EQ(axis(o, y, z), 0);
  EXPECT_EQ(axis(o, z, x), 1);
  EXPECT_EQ(axis(x, y, z), 2);
  EXPECT_EQ(axis(o, ivec3(512, 512, 0), z), 0);
  // Without area: across the longest side.
  EXPECT_EQ(axis(o, x, x), 2);
  EXPECT_EQ(axis(o, z, z), 0);
  EXPECT_EQ(axis(o, ivec3(9, 4, 7), o), 1);
}

TEST(TouchShader, the_dominant_axis_is_the_same_in_two_words) {
  Triangles triangles(4);
  for (int t = 0; t < 20'000; ++t) {
    const Triangle v = triangles.make(t, ivec3(0), t % 2 == 0 ? 2 * 2050 * 256 : 64);
    ASSERT_EQ(split::touch_dominant_axis(v[0], v[1], v[2]),
              wide::touch_dominant_axis(v[0], v[1], v[2]))
        << "triangle " << t;
  }
}

TEST(TouchShader, a_column_is_at_most_five_cells_deep) {
  // The property that the work items' iteration bound relies on.
  Triangles triangles(3);
  for (int t = 0; t < 20'000; ++t) {
    const Triangle v = turned(triangles.make(8, ivec3(2048), triangles.integer(1, 4096)));
    const auto setup = wide::touch_setup(v[0], v[1], v[2], ivec3(255));
    if (setup.normal.z == 0) continue;
    for (int j = setup.cell_min.y; j <= setup.cell_max.y; ++j) {
      for (int i = setup.cell_min.x; i <= setup.cell_max.x; ++i) {
        const int64_t s = wide::touch_height(setup, i, j);
        const auto depth =
            wide::touch_depth(setup, s, wide::touch_low(setup, s), wide::touch_high(setup, s));
        ASSERT_LE(depth.y - depth.x + 1, 5);
      }
    }
  }
}

}  // namespace
}  // namespace voxeld::glsl
