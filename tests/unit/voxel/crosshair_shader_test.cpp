// shaders/lib/crosshair.glsl, as C++, against the oracle: both rules in 32 and in 64 bits, and
// in two words.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>

#include "shaders/glsl.h"
#include "tests/reference/line_oracle.h"

namespace voxeld::glsl {

namespace thin_wide {
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
}  // namespace thin_wide

namespace center_wide {
#define RULE_CENTER
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
#undef RULE_CENTER
}  // namespace center_wide

#undef TOUCH_INT
#undef TOUCH_INT3
#define NO_INT64

namespace thin_split {
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
}  // namespace thin_split

#undef TOUCH_INT
#undef TOUCH_INT3
#undef TOUCH_SPLIT

namespace center_split {
#define RULE_CENTER
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
#undef RULE_CENTER
}  // namespace center_split

#undef NO_INT64
#undef TOUCH_SPLIT
#undef TOUCH_INT
#undef TOUCH_INT3
#define TOUCH_INT int
#define TOUCH_INT3 ivec3

namespace thin_narrow {
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
}  // namespace thin_narrow

namespace center_narrow {
#define RULE_CENTER
#include "shaders/lib/touch.glsl"
//
#include "shaders/lib/crosshair.glsl"
#undef RULE_CENTER
}  // namespace center_narrow

namespace {

using Triangle = std::array<ivec3, 3>;  // q
using Cells = std::set<std::array<int, 3>>;

class Triangles {
 public:
  explicit Triangles(uint64_t seed) : random_(seed) {}

  int integer(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<uint64_t>(high - low + 1));
  }

  // Triangle number t, at most `size` wide; two thirds are of awkward kinds: on a line through
  // centres when seen along an axis, without area, and with a side through a centre.
  Triangle make(int t, ivec3 cell, int size) {
    const int axis = integer(0, 2), x = (axis + 1) % 3, y = (axis + 2) % 3;
    const int slope = 2 * integer(-1, 0) + 1, half = std::max(1, size / 4);
    Triangle v;
    for (ivec3& p : v) {
      const int odd = 2 * integer(-half, half - 1) + 1;
      p = 256 * cell + ivec3(integer(-2 * half, 2 * half), integer(-2 * half, 2 * half),
                             integer(-2 * half, 2 * half));
      if (t % 6 < 3) continue;
      p[x] = 256 * cell[x] + (255 + odd) / 2;
      p[y] = 256 * cell[y] + (255 + odd * slope) / 2;
    }
    if (t % 6 == 4) {
      for (int i = 1; i < 3; ++i)
        v[static_cast<size_t>(i)][axis] = v[0][axis] + v[static_cast<size_t>(i)][x] - v[0][x];
    }
    if (t % 6 == 5) v[2] += ivec3(integer(-9, 9), integer(-9, 9), integer(-9, 9));
    if (t % 6 == 2) {
      for (ivec3& p : v) p = ((p >> 7) << 7) - ivec3(integer(0, 1), integer(0, 1), integer(0, 1));
    }
    return v;
  }

 private:
  std::mt19937_64 random_;
};

// Swizzled so that the dominant axis is z, as the shaders do.
Triangle turned(const Triangle& v) {
  const int axis = thin_wide::touch_dominant_axis(v[0], v[1], v[2]);
  return {thin_wide::touch_swizzle(v[0], axis), thin_wide::touch_swizzle(v[1], axis),
          thin_wide::touch_swizzle(v[2], axis)};
}

reference::Snapped doubled(const Triangle& v) {
  reference::Snapped out{};
  for (size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) out[i][static_cast<size_t>(c)] = 2 * int64_t{v[i][c]} + 1;
  }
  return out;
}

struct Box {
  ivec3 first, last;
};

// Cells of the triangle's box, and one more on each side, that are in `box`.
template <typename Visit>
void for_each_cell(const Triangle& v, const Box& box, const Visit& visit) {
  const ivec3 low = max((min(v[0], min(v[1], v[2])) >> 8) - 1, box.first);
  const ivec3 high = min((max(v[0], max(v[1], v[2])) >> 8) + 1, box.last);
  for (int k = low.z; k <= high.z; ++k) {
    for (int j = low.y; j <= high.y; ++j) {
      for (int i = low.x; i <= high.x; ++i) visit(ivec3(i, j, k));
    }
  }
}

size_t expect_oracle_wide(const Triangle& v, const Box& box) {
  const auto thin = thin_wide::crosshair_setup(v[0], v[1], v[2]);
  const auto center = center_wide::crosshair_setup(v[0], v[1], v[2]);
  const auto split_thin = thin_split::crosshair_setup(v[0], v[1], v[2]);
  const auto split_center = center_split::crosshair_setup(v[0], v[1], v[2]);
  size_t occupied = 0;
  for_each_cell(v, box, [&](const ivec3& p) {
    const std::array<int, 3> cell = {p.x, p.y, p.z};
    const bool is_thin = reference::occupies_thin(doubled(v), cell);
    EXPECT_EQ(thin_wide::crosshair_meets(thin, p), is_thin);
    const bool is_center = reference::occupies_center(doubled(v), cell);
    EXPECT_EQ(center_wide::crosshair_meets(center, p), is_center);
    EXPECT_EQ(thin_split::crosshair_meets(split_thin, p), is_thin);
    EXPECT_EQ(center_split::crosshair_meets(split_center, p), is_center);
    occupied += is_thin ? 1 : 0;
  });
  return occupied;
}

void expect_oracle_narrow(const Triangle& v, const Box& box) {
  const auto thin = thin_narrow::crosshair_setup(v[0], v[1], v[2]);
  const auto center = center_narrow::crosshair_setup(v[0], v[1], v[2]);
  for_each_cell(v, box, [&](const ivec3& p) {
    const std::array<int, 3> cell = {p.x, p.y, p.z};
    EXPECT_EQ(thin_narrow::crosshair_meets(thin, p), reference::occupies_thin(doubled(v), cell));
    EXPECT_EQ(center_narrow::crosshair_meets(center, p),
              reference::occupies_center(doubled(v), cell));
  });
}

constexpr Box kTile = {{0, 0, 0}, {255, 255, 255}};

TEST(CrosshairShader, small_triangles_are_exact_in_32_and_in_64_bits_and_in_two_words) {
  Triangles triangles(1);
  size_t occupied = 0;
  for (int t = 0; t < 6000; ++t) {
    const ivec3 cell(triangles.integer(-2, 257), triangles.integer(-2, 257),
                     triangles.integer(-2, 257));
    const Triangle v =
        turned(triangles.make(t, cell, triangles.integer(1, t % 3 == 0 ? 4000 : 1000)));
    occupied += expect_oracle_wide(v, kTile);
    expect_oracle_narrow(v, kTile);
    ASSERT_FALSE(HasFailure()) << "triangle " << t;
  }
  EXPECT_GT(occupied, 4000u);
}

TEST(CrosshairShader, the_largest_small_triangles_do_not_overflow) {
  // Corners of the largest box at the far end of the tile: |normal| = 2^24 on all axes.
  for (int mask = 0; mask < 512; ++mask) {
    Triangle v;
    for (int i = 0; i < 3; ++i) {
      for (int c = 0; c < 3; ++c) {
        v[static_cast<size_t>(i)][c] = 255 * 256 + 255 +
                                       ((mask >> (3 * i + c) & 1) * TOUCH_SMALL_EXTENT) -
                                       TOUCH_SMALL_EXTENT / 2;
      }
    }
    expect_oracle_narrow(turned(v), kTile);
    ASSERT_FALSE(HasFailure()) << mask;
  }
}

TEST(CrosshairShader, triangles_as_large_as_the_largest_grid_are_exact) {
  Triangles triangles(2);
  size_t occupied = 0;
  for (int t = 0; t < 300; ++t) {
    // The grid's box in the coordinates of one of its tiles.
    const ivec3 tile(triangles.integer(0, 7), triangles.integer(0, 7), triangles.integer(0, 7));
    const ivec3 box_min = -tile * 65536 - 256, box_max = box_min + 2050 * 256 - 1;
    Triangle v = triangles.make(t, ivec3(128), 2050 * 256);
    for (ivec3& p : v) p = glm::clamp(p, box_min, box_max);
    v = turned(v);
    const int a = triangles.integer(0, 1000), b = triangles.integer(0, 1000 - a);
    const glm::dvec3 on = (glm::dvec3(v[0]) * double(a) + glm::dvec3(v[1]) * double(b) +
                           glm::dvec3(v[2]) * double(1000 - a - b)) /
                          256'000.0;
    const ivec3 cell = glm::clamp(ivec3(glm::floor(on)), ivec3(0), ivec3(255));
    occupied += expect_oracle_wide(v, {max(cell - 4, ivec3(0)), min(cell + 4, ivec3(255))});
    ASSERT_FALSE(HasFailure()) << "triangle " << t;
  }
  EXPECT_GT(occupied, 1000u);
}

}  // namespace
}  // namespace voxeld::glsl
