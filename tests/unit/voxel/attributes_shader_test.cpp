// shaders/lib/attributes.glsl as C++, against the words of server/voxel/README.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

#include "shaders/glsl.h"

namespace voxeld::glsl {

#include "shaders/lib/attribute_area.glsl"
#include "shaders/lib/attributes.glsl"

namespace {

struct Words {
  int slope_i = 0, slope_j = 0;
  int64_t reciprocal = 0;
  uint flags = 256;
};

int64_t floor_divide(int64_t a, int64_t b) {
  const int64_t q = a / b;
  return q * b > a ? q - 1 : q;
}

struct Triangle {
  std::array<ivec3, 3> v;
  std::array<int64_t, 3> n() const {
    const ivec3 a = v[1] - v[0], b = v[2] - v[0];
    return {int64_t{a.y} * b.z - int64_t{a.z} * b.y, int64_t{a.z} * b.x - int64_t{a.x} * b.z,
            int64_t{a.x} * b.y - int64_t{a.y} * b.x};
  }
};

// As server/voxel/attributes/attribute_records.cpp makes them, with the form by area.
AttributeTriangle set_up(const Triangle& t) {
  auto n = t.n();
  const int64_t sign = n[2] < 0 ? -1 : 1;
  for (int64_t& c : n) c *= sign;
  Words words;
  if (n[2] != 0) {
    words.slope_i = static_cast<int>(floor_divide(-n[0] * (int64_t{1} << 24), n[2]));
    words.slope_j = static_cast<int>(floor_divide(-n[1] * (int64_t{1} << 24), n[2]));
    words.reciprocal = (int64_t{1} << 57) / n[2];
  } else {
    words.flags = 0;
  }
  return attribute_setup(t.v[0], t.v[1], t.v[2], words.slope_i, words.slope_j, words.reciprocal,
                         words.flags);
}

class Random {
 public:
  explicit Random(uint64_t seed) : random_(seed) {}
  int integer(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<uint64_t>(high - low + 1));
  }
  // With z as dominant axis.
  Triangle triangle(ivec3 low, ivec3 high) {
    for (;;) {
      Triangle t;
      for (ivec3& p : t.v) {
        for (int c = 0; c < 3; ++c) p[c] = integer(low[c], high[c]);
      }
      const auto n = t.n();
      if (n[2] != 0 && std::abs(n[2]) >= std::abs(n[0]) && std::abs(n[2]) >= std::abs(n[1])) {
        return t;
      }
    }
  }

 private:
  std::mt19937_64 random_;
};

double twice_area_of(const std::vector<std::array<double, 2>>& points) {
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto &a = points[i], &b = points[(i + 1) % points.size()];
    sum += a[0] * b[1] - a[1] * b[0];
  }
  return std::abs(sum);
}

// The part of a polygon at form >= 0, in doubles.
template <typename Form>
std::vector<std::array<double, 2>> clipped(const std::vector<std::array<double, 2>>& points,
                                           const Form& form) {
  std::vector<std::array<double, 2>> out;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto &a = points[i], &b = points[(i + 1) % points.size()];
    const double fa = form(a), fb = form(b);
    if (fa >= 0) out.push_back(a);
    if ((fa < 0) == (fb < 0)) continue;
    const double t = fa / (fa - fb);
    out.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
  }
  return out;
}

// The share of a face that the triangle's projection covers in cell (i, j, k), in doubles.
double share_in_cell(const Triangle& t, int i, int j, int k) {
  std::vector<std::array<double, 2>> points;
  for (const ivec3& p : t.v) points.push_back({p.x / 256.0, p.y / 256.0});
  points = clipped(points, [&](const auto& p) { return p[0] - i; });
  points = clipped(points, [&](const auto& p) { return i + 1 - p[0]; });
  points = clipped(points, [&](const auto& p) { return p[1] - j; });
  points = clipped(points, [&](const auto& p) { return j + 1 - p[1]; });
  const auto n = t.n();
  const auto depth = [&](const auto& p) {
    return (t.v[0].z -
            (double(n[0]) * (256 * p[0] - t.v[0].x) + double(n[1]) * (256 * p[1] - t.v[0].y)) /
                double(n[2])) /
           256;
  };
  points = clipped(points, [&](const auto& p) { return depth(p) - k; });
  points = clipped(points, [&](const auto& p) { return k + 1 - depth(p); });
  return twice_area_of(points) / 2;
}

// The mean length of the triangle's sections with cell (i, j, k) on the rows, in doubles.
double share_on_rows(const Triangle& t, int i, int j, int k) {
  const auto n = t.n();
  // In q, as all that follows.
  const double low = std::max(256.0 * j, double(std::min({t.v[0].y, t.v[1].y, t.v[2].y})));
  const double high = std::min(256.0 * (j + 1), double(std::max({t.v[0].y, t.v[1].y, t.v[2].y})));
  double sum = 0;
  for (int r = 0; r < AREA_ROWS; ++r) {
    const double y = low + (high - low) * (r + 0.5) / AREA_ROWS;
    double first = 256.0 * i, last = first + 256;
    // Keeps x where value + slope x >= 0.
    const auto cut = [&](double value, double slope) {
      if (slope > 0) first = std::max(first, -value / slope);
      if (slope < 0) last = std::min(last, -value / slope);
      if (slope == 0 && value < 0) last = first;
    };
    const double turn = n[2] < 0 ? -1 : 1;
    for (size_t e = 0; e < 3; ++e) {
      const ivec3 from = t.v[e], d = t.v[(e + 1) % 3] - from;
      cut(turn * (d.x * (y - from.y) + double(d.y) * from.x), -turn * d.y);
    }
    const double slope = -double(n[0]) / double(n[2]);
    const double depth = t.v[0].z - slope * t.v[0].x - double(n[1]) / double(n[2]) * (y - t.v[0].y);
    cut(depth - 256.0 * k, slope);
    cut(256.0 * (k + 1) - depth, -slope);
    sum += std::max(last - first, 0.0) / 256;
  }
  return sum / AREA_ROWS * std::max(high - low, 0.0) / 256;
}

CellArea cell_at(const AttributeTriangle& a, int i, int j, int k) {
  return cell_area(a, triangle_rows(a, i, j), column_depth_at(a, i, j), k);
}
uint area_in_cell(const AttributeTriangle& a, int i, int j, int k) {
  const CellArea cell = cell_at(a, i, j, k);
  return rows_area(cell, all_rows(cell));
}
ivec2 sample_in_cell(const AttributeTriangle& a, int i, int j, int k) {
  const CellArea cell = cell_at(a, i, j, k);
  return sample_position(a, i, j, cell, all_rows(cell));
}

TEST(AttributesShader, areas_in_cells_are_those_of_clipped_triangles) {
  Random random(1);
  const ivec3 box_min(-7 * 65536 - 256), box_max = box_min + 2050 * 256;
  int counted = 0;
  int rounded = 0;
  double errors = 0, squares = 0;
  for (int t = 0; t < 40'000; ++t) {
    const bool huge = t % 4 == 0;
    const Triangle triangle =
        huge ? random.triangle(box_min, box_max)
             : random.triangle(ivec3(-300), t % 4 == 1 ? ivec3(300) : ivec3(2000, 2000, 500));
    const AttributeTriangle a = set_up(triangle);
    const int i = random.integer(0, huge ? 255 : 2), j = random.integer(0, huge ? 255 : 2);
    const int64_t depth = column_depth_at(a, i, j);
    for (int k = int(depth >> 24) - 2; k <= int(depth >> 24) + 2; ++k) {
      const double share = double(area_in_cell(a, i, j, k)) / AREA_FACE;
      // Sides nearly along a row cross it where their rounding says, so single cells may differ.
      const double on_rows = std::abs(share - share_on_rows(triangle, i, j, k));
      ASSERT_LT(on_rows, 1.0 / 64) << t;
      rounded += on_rows > 1.0 / 1000 ? 1 : 0;
      const double expected = share_in_cell(triangle, i, j, k);
      ASSERT_NEAR(share, expected, 1.0 / 16) << t;
      if (expected < 0.01) continue;
      ++counted;
      errors += share - expected;
      squares += (share - expected) * (share - expected);
    }
  }
  EXPECT_GT(counted, 5'000);
  EXPECT_LT(rounded, 10);
  EXPECT_LT(std::abs(errors / counted), 0.001);
  EXPECT_LT(std::sqrt(squares / counted), 0.005);
}

TEST(AttributesShader, triangles_with_a_common_side_share_a_column_out) {
  for (const int shift : {0, 31, 32, 63, 64}) {
    const ivec3 a(shift, shift, 9), b(shift + 1024, shift, 9), c(shift + 1024, shift + 1024, 9),
        d(shift, shift + 1024, 9);
    const AttributeTriangle lower = set_up({{a, b, c}}), upper = set_up({{a, c, d}});
    const AttributeTriangle flipped = set_up({{c, a, d}});
    for (int j = 1; j < 4; ++j) {
      for (int i = 1; i < 4; ++i) {
        const uint one = area_in_cell(lower, i, j, 0);
        const uint other = area_in_cell(upper, i, j, 0);
        EXPECT_EQ(one + other, uint(AREA_FACE));
        EXPECT_EQ(area_in_cell(flipped, i, j, 0), other);
      }
    }
  }
}

TEST(AttributesShader, a_square_on_the_boundaries_of_cells_fills_a_layer) {
  const AttributeTriangle a =
      set_up({{ivec3(0, 0, 512), ivec3(2048, 0, 512), ivec3(0, 2048, 512)}});
  EXPECT_EQ(area_in_cell(a, 1, 1, 2), uint(AREA_FACE));
  EXPECT_EQ(area_weight(a, uint(AREA_FACE)), 4096u);
  EXPECT_EQ(area_in_cell(a, 1, 1, 1), 0u);
  EXPECT_EQ(area_weight(a, 0u), 1u);
}

TEST(AttributesShader, depths_are_those_of_the_plane) {
  Random random(2);
  for (int t = 0; t < 5'000; ++t) {
    const Triangle triangle = random.triangle(ivec3(0), ivec3(65535));
    const AttributeTriangle a = set_up(triangle);
    const auto n = triangle.n();
    const int i = random.integer(0, 255), j = random.integer(0, 255);
    // At the corner of column (i, j), in cells.
    const double x = 256.0 * i - triangle.v[0].x, y = 256.0 * j - triangle.v[0].y;
    const double z =
        (triangle.v[0].z - (double(n[0]) * x + double(n[1]) * y) / double(n[2])) / 256.0;
    ASSERT_NEAR(double(column_depth_at(a, i, j)) * 0x1p-24, z, 0x1p-14) << t;
  }
}

// Steep, shallow and level lines: what one side of a line does not get, the other one gets.
TEST(AttributesShader, two_sides_of_a_line_share_every_row_out) {
  Random random(3);
  for (int t = 0; t < 50'000; ++t) {
    const int steep = random.integer(0, 15), shallow = random.integer(0, 15);
    const int a = random.integer(0, (1 << steep) - 1),
              b = random.integer(-(1 << shallow), 1 << shallow);
    const int constant = random.integer(-(1 << 29), 1 << 29) >> random.integer(0, 20);
    const RowLine line = row_line(a, b);
    const ColumnRows right = clip_rows(box_rows(0, AREA_SIDE), line, constant, true);
    const ColumnRows left = clip_rows(box_rows(0, AREA_SIDE), line, constant, false);
    for (int r = 0; r < AREA_ROWS; ++r) {
      const int x = row_crossing(line, constant, row_y(right, r));
      ASSERT_TRUE(x >= 0 && x <= AREA_SIDE);
      ASSERT_EQ(right.rows[r], uint(x) | uint(AREA_SIDE) << 16);
      ASSERT_EQ(left.rows[r], uint(x) << 16);
      const double rest = -(double(b) * AREA_SIDE * (r + 0.5) / AREA_ROWS + constant);
      const double exact = a == 0 ? (rest > 0 ? AREA_SIDE : 0) : rest / a;
      ASSERT_NEAR(x, std::clamp(exact, 0.0, double(AREA_SIDE)), 1.25) << a << ' ' << b;
    }
  }
}

TEST(AttributesShader, the_sample_is_the_centroid_or_the_centre_in_the_box) {
  const AttributeTriangle whole = set_up({{ivec3(0, 0, 0), ivec3(4000, 0, 0), ivec3(0, 4000, 0)}});
  EXPECT_EQ(sample_in_cell(whole, 2, 3, 0), ivec2(2 * 512 + 257, 3 * 512 + 257));
  const AttributeTriangle t = set_up({{ivec3(0, 0, 0), ivec3(120, 0, 0), ivec3(0, 240, 0)}});
  const ivec2 at = sample_in_cell(t, 0, 0, 0);
  EXPECT_NEAR(at.x, 2 * 120 / 3.0 + 1, 3);
  EXPECT_NEAR(at.y, 2 * 240 / 3.0 + 1, 3);
  EXPECT_EQ(area_in_cell(t, 0, 0, 1), 0u);
  EXPECT_EQ(sample_in_cell(t, 0, 0, 1), ivec2(241, 256));
}

TEST(AttributesShader, parts_of_a_length_share_all_of_it_out) {
  EXPECT_EQ(length_share(0u, uint(AREA_FACE)), 0u);
  EXPECT_EQ(length_share(uint(AREA_FACE), uint(AREA_FACE)), 1u << 15);
  EXPECT_EQ(length_share(uint(AREA_FACE) / 2, uint(AREA_FACE)), 1u << 14);
  EXPECT_EQ(length_share(1u, 3u), 10922u);
}

TEST(AttributesShader, texels_are_as_large_as_the_part_that_they_stand_for) {
  EXPECT_EQ(part_level(uint(AREA_FACE), 5), 5);
  EXPECT_EQ(part_level(uint(AREA_FACE) / 4, 5), 4);
  EXPECT_EQ(part_level(uint(AREA_FACE) / 1024, 5), 0);
  EXPECT_EQ(part_level(1u, 5), 0);
}

TEST(AttributesShader, the_halves_of_a_rectangle_have_their_own_centroids) {
  // x from a quarter of the cell to three quarters
  RowSums sums = no_rows();
  for (int r = 0; r < AREA_ROWS; ++r) sums = add_row(sums, 1024, 3072, r);
  CellArea cell{};
  cell.spacing = 256;
  EXPECT_EQ(row_centroid(cell, sums), ivec2(2048, 2048));
  EXPECT_EQ(rows_area(cell, sums), uint(AREA_FACE) / 2);
  EXPECT_EQ(row_spread(sums), 512);
}

TEST(AttributesShader, corner_weights_are_barycentric) {
  Random random(4);
  int inside = 0;
  for (int t = 0; t < 5'000; ++t) {
    const Triangle triangle = random.triangle(ivec3(0), ivec3(random.integer(64, 65535)));
    const AttributeTriangle a = set_up(triangle);
    const ivec2 at(random.integer(0, 131071), random.integer(0, 131071));
    const ivec3 w = corner_weights(a, at);
    ASSERT_EQ(w.x + w.y + w.z, 1 << 24);
    ASSERT_GE(std::min({w.x, w.y, w.z}), 0);
    // 1/512 of a cell is half of q.
    const auto area = [](double ax, double ay, double bx, double by) { return ax * by - ay * bx; };
    std::array<double, 3> expected{};
    for (size_t i = 0; i < 3; ++i) {
      const ivec3 b = triangle.v[(i + 1) % 3], c = triangle.v[(i + 2) % 3];
      expected[i] = area(c.x - b.x, c.y - b.y, 0.5 * at.x - b.x - 0.5, 0.5 * at.y - b.y - 0.5) /
                    double(triangle.n()[2]);
    }
    if (*std::min_element(expected.begin(), expected.end()) < 0) continue;
    ++inside;
    for (int i = 0; i < 3; ++i) {
      ASSERT_NEAR(w[i] * 0x1p-24, expected[static_cast<size_t>(i)], 0x1p-18) << t;
    }
  }
  EXPECT_GT(inside, 50);
}

TEST(AttributesShader, slivers_weigh_the_ends_of_their_longest_side) {
  const ivec3 v0(0, 0, 0), v1(1024, 8, 0), v2(4096, 0, 0);
  const int64_t reciprocal = (int64_t{1} << 57) / (int64_t{4096} * 4096);
  const uint flags = 256u | uint(ATTRIBUTE_FORM_02) << ATTRIBUTE_FORM_SHIFT;
  const AttributeTriangle t = attribute_setup(v0, v1, v2, 0, 0, reciprocal, flags);
  for (const int x : {0, 256, 512, 1023}) {
    const ivec3 w = corner_weights(t, ivec2(8 * x, 0));
    EXPECT_EQ(w.y, 0);
    EXPECT_NEAR(w.z * 0x1p-24, x / 1024.0, 1e-3);
    EXPECT_EQ(w.x + w.z, 1 << 24);
  }
  const uint flags12 = 256u | uint(ATTRIBUTE_FORM_12) << ATTRIBUTE_FORM_SHIFT;
  const AttributeTriangle other = attribute_setup(v1, v0, v2, 0, 0, reciprocal, flags12);
  const ivec3 w = corner_weights(other, ivec2(8 * 256, 0));
  EXPECT_NEAR(w.y * 0x1p-24, 0.75, 1e-3);
  EXPECT_NEAR(w.z * 0x1p-24, 0.25, 1e-3);
  EXPECT_LE(w.x, 1);
}

TEST(AttributesShader, taps_are_coarser_the_farther_they_are_from_the_sides) {
  const int one = 1 << 24;
  const ivec3 middle(one / 3, one / 3, one - 2 * (one / 3));
  // Altitude in texels; the sides are a third of it away, and 3/2 2^level is less than that.
  for (const auto& [texels, level] : {std::pair{0, 0},
                                      {4, 0},
                                      {8, 0},
                                      {10, 1},
                                      {17, 1},
                                      {19, 2},
                                      {37, 3},
                                      {290, 6},
                                      {9000, 10}}) {
    const auto altitude = static_cast<uint>(std::min(65535, texels * 16 / 3));
    EXPECT_EQ(tap_level(middle, altitude, 15), level) << texels;
    EXPECT_EQ(tap_level(middle, altitude, 2), std::min(level, 2)) << texels;
  }
  EXPECT_EQ(tap_level({one, 0, 0}, 65535, 15), 0);
  EXPECT_EQ(tap_level({0, one - 5, 5}, 65535, 15), 0);
}

TEST(AttributesShader, coordinates_of_a_texture_wrap_at_every_size) {
  const int one = 1 << ATTRIBUTE_UV_BITS;
  for (const int size : {1, 3, 256, 32768}) {
    const int last = 256 * size - 128;  // at the far side
    EXPECT_EQ(level_coordinate(0, size, ATTRIBUTE_WRAP_CLAMP), -128);
    EXPECT_EQ(level_coordinate(-5 * one, size, ATTRIBUTE_WRAP_CLAMP), -128);
    EXPECT_EQ(level_coordinate(7 * one, size, ATTRIBUTE_WRAP_CLAMP), last);
    EXPECT_EQ(level_coordinate(one / 2, size, ATTRIBUTE_WRAP_REPEAT), 128 * size - 128);
    EXPECT_EQ(level_coordinate(-2000 * one - one / 2, size, ATTRIBUTE_WRAP_REPEAT),
              128 * size - 128);
    EXPECT_EQ(level_coordinate(2047 * one, size, ATTRIBUTE_WRAP_REPEAT), -128);
    EXPECT_EQ(level_coordinate(-one / 2, size, ATTRIBUTE_WRAP_MIRROR), 384 * size - 128);
    EXPECT_EQ(level_coordinate(one, size, ATTRIBUTE_WRAP_MIRROR), last);
  }
}

TEST(AttributesShader, a_triangle_of_one_point_has_weights_and_no_area) {
  const ivec3 p(300, 300, 300);
  const AttributeTriangle t = attribute_setup(p, p, p, 0, 0, 0, 0u);
  EXPECT_EQ(area_in_cell(t, 1, 1, 1), 0u);
  EXPECT_EQ(corner_weights(t, sample_in_cell(t, 1, 1, 1)), ivec3(1 << 24, 0, 0));
}

TEST(AttributesShader, products_of_fractions_keep_white_and_black) {
  for (uint x = 0; x < 65536; ++x) {
    ASSERT_EQ(product16(x, 65535u), x);
    ASSERT_EQ(product16(65535u, x), x);
    ASSERT_EQ(product16(x, 0u), 0u);
    ASSERT_NEAR(product16(x, 32768u), x * (32768.0 / 65535.0), 1.0);
  }
}

// One period, and one texel beyond it on either side.
TEST(AttributesShader, texels_wrap) {
  const auto row = [](uint wrap, int last) {
    std::vector<int> at;
    for (int x = -1; x <= last; ++x) at.push_back(wrap_texel(x, 3, wrap));
    return at;
  };
  EXPECT_EQ(row(ATTRIBUTE_WRAP_REPEAT, 3), (std::vector{2, 0, 1, 2, 0}));
  EXPECT_EQ(row(ATTRIBUTE_WRAP_CLAMP, 3), (std::vector{0, 0, 1, 2, 2}));
  EXPECT_EQ(row(ATTRIBUTE_WRAP_MIRROR, 6), (std::vector{0, 0, 1, 2, 2, 1, 0, 0}));
}

}  // namespace
}  // namespace voxeld::glsl
