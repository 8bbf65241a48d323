// shaders/lib/attributes.glsl as C++, against the words of server/voxel/README.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "shaders/glsl.h"

namespace voxeld::glsl {

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

// As server/voxel/attribute_records.cpp makes them, with the form by area.
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

// Side functions of a lattice point, by the definition.
bool inside(const Triangle& t, int i, int j, int m, int n) {
  const int64_t x = 512 * int64_t{i} + 128 * m + 64, y = 512 * int64_t{j} + 128 * n + 64;
  const int64_t side = t.n()[2] >= 0 ? 1 : -1;
  for (size_t e = 0; e < 3; ++e) {
    const ivec3 from = t.v[e], d = t.v[(e + 1) % 3] - from;
    const int64_t a = -d.y * side, b = d.x * side;
    const int64_t value = a * (x - 2 * from.x - 1) + b * (y - 2 * from.y - 1);
    if (value < 0 || (value == 0 && !(a > 0 || (a == 0 && b > 0)))) return false;
  }
  return true;
}

TEST(AttributesShader, lattice_points_inside_are_those_of_the_definition) {
  Random random(1);
  const ivec3 box_min(-7 * 65536 - 256), box_max = box_min + 2050 * 256;
  for (int t = 0; t < 20'000; ++t) {
    const bool huge = t % 2 == 0;
    const Triangle triangle = huge ? random.triangle(box_min, box_max)
                                   : random.triangle(ivec3(-300), ivec3(2000, 2000, 500));
    const AttributeTriangle a = set_up(triangle);
    const int i = random.integer(0, huge ? 255 : 8), j = random.integer(0, huge ? 255 : 8);
    const uint points = lattice_inside(a, i, j);
    for (int n = 0; n < 4; ++n) {
      for (int m = 0; m < 4; ++m) {
        ASSERT_EQ((points >> (m + 4 * n) & 1u) != 0, inside(triangle, i, j, m, n)) << t;
      }
    }
  }
}

TEST(AttributesShader, a_lattice_point_on_a_shared_side_belongs_to_one_triangle) {
  // The diagonal of each square runs through lattice points.
  for (const int shift : {0, 31, 32, 63, 64}) {
    const ivec3 a(shift, shift, 0), b(shift + 1024, shift, 0), c(shift + 1024, shift + 1024, 0),
        d(shift, shift + 1024, 0);
    const AttributeTriangle lower = set_up({{a, b, c}}), upper = set_up({{a, c, d}});
    const AttributeTriangle flipped = set_up({{c, a, d}});
    for (int j = 1; j < 4; ++j) {
      for (int i = 1; i < 4; ++i) {
        const uint one = lattice_inside(lower, i, j), other = lattice_inside(upper, i, j);
        EXPECT_EQ(one & other, 0u);
        EXPECT_EQ(one | other, 0xffffu);
        EXPECT_EQ(lattice_inside(flipped, i, j), other);
      }
    }
  }
}

TEST(AttributesShader, depths_are_those_of_the_plane) {
  Random random(2);
  for (int t = 0; t < 5'000; ++t) {
    const Triangle triangle = random.triangle(ivec3(0), ivec3(65535));
    const AttributeTriangle a = set_up(triangle);
    const auto n = triangle.n();
    const int i = random.integer(0, 255), j = random.integer(0, 255);
    // At the corner of column (i, j), in cells.
    const double x = 256.0 * i - triangle.v[0].x - 0.5, y = 256.0 * j - triangle.v[0].y - 0.5;
    const double z =
        (triangle.v[0].z + 0.5 - (double(n[0]) * x + double(n[1]) * y) / double(n[2])) / 256.0;
    ASSERT_NEAR(double(lattice_depth(a, i, j)) * 0x1p-24, z, 0x1p-14) << t;
  }
}

TEST(AttributesShader, every_point_of_a_column_lies_in_one_cell) {
  Random random(3);
  for (int t = 0; t < 5'000; ++t) {
    const Triangle triangle = random.triangle(ivec3(0), ivec3(4096));
    const AttributeTriangle a = set_up(triangle);
    const int i = random.integer(0, 15), j = random.integer(0, 15);
    const int64_t depth = lattice_depth(a, i, j);
    const int middle = static_cast<int>(depth >> 24);
    uint all = 0;
    for (int k = middle - 3; k <= middle + 3; ++k) {
      const uint points = lattice_in_cell(a, depth, k);
      ASSERT_EQ(all & points, 0u);
      all |= points;
    }
    ASSERT_EQ(all, 0xffffu);
  }
}

TEST(AttributesShader, the_sample_is_the_mean_of_the_points_or_the_centre_in_the_box) {
  AttributeTriangle t = set_up({{ivec3(0, 0, 0), ivec3(40, 0, 0), ivec3(0, 80, 0)}});
  EXPECT_EQ(sample_position(t, 2, 3, 0xffffu), ivec2(2 * 64 + 32, 3 * 64 + 32));
  EXPECT_EQ(sample_position(t, 0, 0, 0x0001u), ivec2(8, 8));
  EXPECT_EQ(sample_position(t, 0, 0, 0x8000u), ivec2(56, 56));
  EXPECT_EQ(sample_position(t, 0, 0, 0x0013u), ivec2(8 + 16 / 3, 8 + 16 / 3));
  EXPECT_EQ(sample_position(t, 0, 0, 0u), ivec2(10, 20));
}

TEST(AttributesShader, corner_weights_are_barycentric) {
  Random random(4);
  for (int t = 0; t < 5'000; ++t) {
    const Triangle triangle = random.triangle(ivec3(0), ivec3(random.integer(64, 65535)));
    const AttributeTriangle a = set_up(triangle);
    const ivec2 at(random.integer(0, 16383), random.integer(0, 16383));
    const ivec3 w = corner_weights(a, at);
    ASSERT_EQ(w.x + w.y + w.z, 1 << 24);
    ASSERT_GE(std::min({w.x, w.y, w.z}), 0);
    // 1/64 of a cell is 4 of q.
    const auto area = [](double ax, double ay, double bx, double by) { return ax * by - ay * bx; };
    std::array<double, 3> expected{};
    for (size_t i = 0; i < 3; ++i) {
      const ivec3 b = triangle.v[(i + 1) % 3], c = triangle.v[(i + 2) % 3];
      expected[i] = area(c.x - b.x, c.y - b.y, 4.0 * at.x - b.x - 0.5, 4.0 * at.y - b.y - 0.5) /
                    double(triangle.n()[2]);
    }
    if (*std::min_element(expected.begin(), expected.end()) < 0) continue;
    for (int i = 0; i < 3; ++i) {
      ASSERT_NEAR(w[i] * 0x1p-24, expected[static_cast<size_t>(i)], 0x1p-18) << t;
    }
  }
}

TEST(AttributesShader, slivers_weigh_the_ends_of_their_longest_side) {
  const ivec3 v0(0, 0, 0), v1(1024, 8, 0), v2(4096, 0, 0);
  const int64_t reciprocal = (int64_t{1} << 57) / (int64_t{4096} * 4096);
  const uint flags = 256u | uint(ATTRIBUTE_FORM_02) << ATTRIBUTE_FORM_SHIFT;
  const AttributeTriangle t = attribute_setup(v0, v1, v2, 0, 0, reciprocal, flags);
  for (const int x : {0, 256, 512, 1023}) {
    const ivec3 w = corner_weights(t, ivec2(x, 0));
    EXPECT_EQ(w.y, 0);
    EXPECT_NEAR(w.z * 0x1p-24, x / 1024.0, 1e-3);
    EXPECT_EQ(w.x + w.z, 1 << 24);
  }
  const uint flags12 = 256u | uint(ATTRIBUTE_FORM_12) << ATTRIBUTE_FORM_SHIFT;
  const AttributeTriangle other = attribute_setup(v1, v0, v2, 0, 0, reciprocal, flags12);
  const ivec3 w = corner_weights(other, ivec2(256, 0));
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

TEST(AttributesShader, quarters_of_a_column_share_its_points_out) {
  uint all = 0;
  for (int number = 0; number < 4; ++number) {
    const uint part = tap_points(0xffffu, number);
    EXPECT_EQ(bitCount(part), 4);
    EXPECT_EQ(all & part, 0u);
    all |= part;
  }
  EXPECT_EQ(all, 0xffffu);
  EXPECT_EQ(tap_points(0xffffu, 3), 0xcc00u);
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

TEST(AttributesShader, a_triangle_of_one_point_has_weights_and_no_lattice_points) {
  const ivec3 p(300, 300, 300);
  const AttributeTriangle t = attribute_setup(p, p, p, 0, 0, 0, 0u);
  EXPECT_EQ(lattice_inside(t, 1, 1), 0u);
  EXPECT_EQ(corner_weights(t, sample_position(t, 1, 1, 0u)), ivec3(1 << 24, 0, 0));
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
