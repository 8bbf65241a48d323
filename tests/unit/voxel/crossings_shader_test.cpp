// shaders/lib/crossings.glsl, as C++, against the definition in 128 bits.
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "shaders/glsl.h"

namespace voxeld::glsl {

#include "shaders/lib/crossings.glsl"

namespace {

__extension__ using Wide = __int128;
using Corners = std::array<ivec3, 3>;

struct Expected {
  bool inside = false;
  int cell = 0, winding = 0;
};

Wide divided_down(Wide a, Wide b) {
  const Wide quotient = a / b;
  return a % b != 0 && (a < 0) != (b < 0) ? quotient - 1 : quotient;
}

// By server/voxel/README.md, "What is inside"; P is the centre of the column.
Expected expected(const Corners& v, int i, int j) {
  const Wide pu = 512 * i + 256, pv = 512 * j + 256;
  const auto product = [&](int a, int b) {
    return Wide{v[1][a] - v[0][a]} * (v[2][b] - v[0][b]) -
           Wide{v[1][b] - v[0][b]} * (v[2][a] - v[0][a]);
  };
  const Wide nu = product(1, 2), nv = product(2, 0), nw = product(0, 1);
  Expected result;
  if (nw == 0) return result;
  result.winding = nw < 0 ? 1 : -1;
  result.inside = true;
  for (size_t s = 0; s < 3; ++s) {
    const ivec3 &from = v[s], &to = v[(s + 1) % 3];
    const Wide side = nw < 0 ? -1 : 1;
    const Wide a = -side * (to.y - from.y), b = side * (to.x - from.x);
    const Wide e = a * (pu - from.x) + b * (pv - from.y);
    result.inside = result.inside && (e > 0 || (e == 0 && (a > 0 || (a == 0 && b > 0))));
  }
  // Least k with 512 k + 256 >= depth, depth = numerator / nw.
  const Wide numerator = nw * v[0].z - nu * (pu - v[0].x) - nv * (pv - v[0].y);
  result.cell = static_cast<int>(-divided_down(-(numerator - 256 * nw), 512 * nw));
  return result;
}

class Triangles {
 public:
  explicit Triangles(uint64_t seed) : random_(seed) {}

  int integer(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<uint64_t>(high - low + 1));
  }
  // Corners at odd numbers below `reach`; some with sides through centres of columns.
  Corners make(int t, int reach) {
    Corners v;
    const ivec3 centre(512 * integer(0, 7) + 256, 512 * integer(0, 7) + 256, integer(0, 4000));
    for (ivec3& p : v) {
      for (int c = 0; c < 3; ++c) p[c] = 2 * integer(-reach / 2, reach / 2 - 1) + 1;
    }
    if (t % 3 == 1) {
      v[1].x = 2 * centre.x - v[0].x;  // the centre halves a side
      v[1].y = 2 * centre.y - v[0].y;
    }
    if (t % 3 == 2) v[1].y = v[0].y;
    for (ivec3& p : v) p = clamp(p, ivec3(1 - CROSSING_P_MAX), ivec3(CROSSING_P_MAX - 1));
    return v;
  }

 private:
  std::mt19937_64 random_;
};

TEST(CrossingsShader, columns_cross_triangles_where_the_definition_says) {
  Triangles triangles(5);
  int inside = 0, ties = 0;
  for (const int reach : {600, 5000, 60'000, CROSSING_P_MAX}) {
    for (int t = 0; t < 3000; ++t) {
      const Corners v = triangles.make(t, reach);
      const ColumnTriangle triangle = crossing_setup(v[0], v[1], v[2]);
      for (int n = 0; n < 64; ++n) {
        const int i = n % 8, j = n / 8;
        const Expected wanted = expected(v, i, j);
        ASSERT_EQ(crossing_inside(triangle, i, j), wanted.inside) << t << " " << n;
        if (!wanted.inside) continue;
        ++inside;
        ASSERT_EQ(triangle.winding, wanted.winding);
        ASSERT_EQ(crossing_first_cell(triangle, i, j), wanted.cell) << t << " " << n;
        ties += crossing_edge_at(triangle.edge0, i, j) == 0 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(inside, 50'000);
  EXPECT_GT(ties, 100);
}

TEST(CrossingsShader, a_centre_on_a_level_triangle_lies_above_it) {
  // Planes through centres of cells: no corner of a mesh stands at an even number, but a plane
  // does: z is 256, the centre of cell 0, where y is 256, at the centres of row 0.
  const Corners v = {ivec3(-1001, -1001, 255), ivec3(5001, -1001, 255), ivec3(-1001, 1513, 257)};
  const ColumnTriangle triangle = crossing_setup(v[0], v[1], v[2]);
  for (int i = 0; i < 4; ++i) {
    const Expected wanted = expected(v, i, 0);
    ASSERT_TRUE(wanted.inside);
    EXPECT_EQ(wanted.cell, 0);
    ASSERT_TRUE(crossing_inside(triangle, i, 0));
    EXPECT_EQ(crossing_first_cell(triangle, i, 0), wanted.cell);
  }
}

}  // namespace
}  // namespace voxeld::glsl
