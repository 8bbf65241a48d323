// The oracle itself, checked against cases that a person can work out.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/reference/color_oracle.h"
#include "tests/reference/line_oracle.h"
#include "tests/reference/texture_oracle.h"
#include "tests/reference/touch_oracle.h"

namespace voxeld::reference {
namespace {

const OracleGrid kGrid4 = {{4, 4, 4}, {0, 0, 0}, {1, 1, 1}};

TEST(TouchOracle, a_quad_on_a_grid_plane_fills_one_layer) {
  const std::vector<Triangle> quad = {Triangle{Point{0, 0, 2}, Point{4, 0, 2}, Point{4, 4, 2}},
                                      Triangle{Point{0, 0, 2}, Point{4, 4, 2}, Point{0, 4, 2}}};
  const Occupancy cells = touched_cells(quad, kGrid4);
  EXPECT_EQ(count(cells), 16u);
  for (size_t i = 0; i < 16; ++i) EXPECT_EQ(cells[32 + i], 1) << i;
}

TEST(TouchOracle, the_far_face_of_the_box_stays_inside) {
  const std::vector<Triangle> quad = {Triangle{Point{4, 0, 0}, Point{4, 4, 0}, Point{4, 4, 4}},
                                      Triangle{Point{4, 0, 0}, Point{4, 4, 4}, Point{4, 0, 4}}};
  const Occupancy cells = touched_cells(quad, kGrid4);
  EXPECT_EQ(count(cells), 16u);
  for (size_t i = 0; i < 16; ++i) EXPECT_EQ(cells[4 * i + 3], 1) << i;
}

TEST(TouchOracle, a_point_occupies_its_cell) {
  const Point p = {1.5, 2.5, 3.5};
  const Occupancy cells = touched_cells({Triangle{p, p, p}}, kGrid4);
  EXPECT_EQ(count(cells), 1u);
  EXPECT_EQ(cells[1 + 4 * 2 + 16 * 3], 1);
}

TEST(TouchOracle, a_diagonal_segment_through_corners_touches_all_cells_at_each_corner) {
  // Snapped ends (1/512, 1/512, 1/512) and (4 - 1/512, …): the line x = y = z passes through the
  // corners (1,1,1), (2,2,2), (3,3,3), and each corner belongs to 8 closed cubes.
  const Occupancy cells =
      touched_cells({Triangle{Point{0, 0, 0}, Point{4, 4, 4}, Point{0, 0, 0}}}, kGrid4);
  EXPECT_EQ(count(cells), 4u + 3u * 6u);
}

TEST(TouchOracle, snapping_moves_by_at_most_half_a_sub_voxel) {
  for (double p = 0; p < 4; p += 0.000917) {
    const int64_t q = snap_512(p, 4);
    EXPECT_EQ(q & 1, 1);
    EXPECT_LE(std::abs(static_cast<double>(q) / 512 - p), 1.0 / 512 + 1e-12);
  }
}

TEST(LineOracle, a_plane_of_slope_one_half_is_thinner_than_the_cells_it_touches) {
  // z = 1/2 + x/2 over x, y in [0, 4]; snapping moves all corners alike.
  const std::vector<Triangle> quad = {
      Triangle{Point{0, 0, 0.5}, Point{4, 0, 2.5}, Point{4, 4, 2.5}},
      Triangle{Point{0, 0, 0.5}, Point{4, 4, 2.5}, Point{0, 4, 0.5}}};
  const Occupancy thin = thin_cells(quad, kGrid4), center = center_cells(quad, kGrid4);
  // By the columns at x = 0.5, 1.5, 2.5, 3.5: z = 0.75, 1.25, 1.75, 2.25. Along x, lines at
  // z = 0.5, 1.5, 2.5 meet it at x = 0, 2 and 4: cells (0, 0), (2 or 1, 1) and (3, 2).
  const std::array<int, 4> column = {0, 1, 1, 2};
  EXPECT_EQ(count(center), 16u);
  for (size_t x = 0; x < 4; ++x) {
    for (size_t y = 0; y < 4; ++y) {
      const auto z = static_cast<size_t>(column[x]);
      EXPECT_EQ(center[x + 4 * y + 16 * z], 1) << x << " " << y;
      EXPECT_EQ(thin[x + 4 * y + 16 * z], 1) << x << " " << y;
    }
  }
  EXPECT_EQ(count(thin), 16u);
  EXPECT_GT(count(touched_cells(quad, kGrid4)), 16u);
}

TEST(LineOracle, a_wall_seen_edge_on_over_centres_is_a_segment_in_each_line) {
  // The plane x = y, 1 to 3.5 high; in 1/512 voxel, so that it holds the centres (i, i) exactly.
  const Snapped low = {{{1, 1, 513}, {2047, 2047, 513}, {2047, 2047, 1791}}};
  const Snapped high = {{{1, 1, 513}, {2047, 2047, 1791}, {1, 1, 1791}}};
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) {
      // Cells (i, i) are met along z where the wall is; along x and y, the lines at z = k + 1/2.
      const bool occupied = occupies_thin(low, {i, i, k}) || occupies_thin(high, {i, i, k});
      EXPECT_EQ(occupied, k >= 1) << i << " " << k;
    }
  }
  EXPECT_FALSE(occupies_thin(low, {1, 2, 2}) || occupies_thin(high, {1, 2, 2}));
  // By the dominant axis, x, of the lines at z = 1.5 and 2.5 alone.
  EXPECT_TRUE(occupies_center(low, {2, 2, 1}) != occupies_center(high, {2, 2, 1}));
  EXPECT_FALSE(occupies_center(low, {2, 2, 3}) || occupies_center(high, {2, 2, 3}));
}

TEST(LineOracle, a_centre_on_a_shared_side_belongs_to_one_triangle_by_center_and_to_both_by_thin) {
  const Snapped below = {{{1, 1, 301}, {2047, 1, 301}, {2047, 2047, 301}}};
  const Snapped above = {{{1, 1, 301}, {2047, 2047, 301}, {1, 2047, 301}}};
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(occupies_thin(below, {i, i, 0}) && occupies_thin(above, {i, i, 0}));
    EXPECT_TRUE(occupies_center(below, {i, i, 0}) != occupies_center(above, {i, i, 0}));
  }
}

TEST(LineOracle, triangles_without_area_have_no_centres_but_may_meet_lines) {
  const Snapped segment = {{{1, 1, 1}, {2047, 2047, 2047}, {1023, 1023, 1023}}};
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(occupies_thin(segment, {i, i, i})) << i;
    EXPECT_FALSE(occupies_center(segment, {i, i, i})) << i;
  }
  const Snapped point = {{{257, 257, 257}, {257, 257, 257}, {257, 257, 257}}};
  EXPECT_FALSE(occupies_thin(point, {0, 0, 0}));
}

TEST(LineOracle, a_hollow_box_is_enclosed_until_a_cell_is_missing) {
  Occupancy cells(64);
  for (size_t i = 0; i < 64; ++i) {
    const size_t x = i % 4, y = i / 4 % 4, z = i / 16;
    cells[i] = x == 0 || y == 0 || z == 0 || x == 3 || y == 3 || z == 3;
  }
  EXPECT_TRUE(is_enclosed(cells, kGrid4, {1, 1, 1}));
  cells[0] = 0;  // A corner has no side in common with the inside.
  EXPECT_TRUE(is_enclosed(cells, kGrid4, {1, 1, 1}));
  cells[1 + 4 * 1 + 16 * 3] = 0;
  EXPECT_FALSE(is_enclosed(cells, kGrid4, {1, 1, 1}));
}

TEST(ColorOracle, a_quad_half_red_half_blue_averages_by_area) {
  const std::vector<Triangle> quad = {
      Triangle{Point{0, 0, 0.5}, Point{1, 0, 0.5}, Point{1, 1, 0.5}},
      Triangle{Point{0, 0, 0.5}, Point{1, 1, 0.5}, Point{0, 1, 0.5}}};
  const auto cells = average_colors(quad, kGrid4, [](size_t t, const auto&) {
    return t == 0 ? std::array<double, 4>{1, 0, 0, 1} : std::array<double, 4>{0, 0, 1, 1};
  });
  ASSERT_EQ(cells.count(0), 1u);
  EXPECT_NEAR(cells.at(0).area, 1.0, 1e-12);
  EXPECT_NEAR(cells.at(0).linear_rgba[0], 0.5, 1e-12);
  EXPECT_NEAR(cells.at(0).linear_rgba[2], 0.5, 1e-12);
}

TEST(ColorOracle, a_linear_ramp_integrates_to_the_value_at_the_centroid) {
  const std::vector<Triangle> one = {
      Triangle{Point{0, 0, 0.5}, Point{1, 0, 0.5}, Point{0, 1, 0.5}}};
  const auto cells = average_colors(one, kGrid4, [](size_t, const std::array<double, 3>& bary) {
    return std::array<double, 4>{bary[0], bary[1], bary[2], 1};
  });
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(cells.at(0).linear_rgba[c], 1.0 / 3, 1e-9);
}

TEST(TextureOracle, a_triangle_within_one_repetition_sees_no_other) {
  constexpr std::array<uint8_t, 8> kTexels{255, 255, 255, 255, 0, 0, 0, 0};
  const Texture texture{2, 1, kTexels};
  const std::array<double, 3> last{0, 1, 0};
  const auto alpha_at_last = [&](double from, double to) {
    return texture_color(texture, {{{from, 0}, {to, 0}, {from, 1}}}, last)[3];
  };
  EXPECT_EQ(alpha_at_last(0, 1), 0);
  EXPECT_EQ(alpha_at_last(-3, -2), 0);
  EXPECT_EQ(alpha_at_last(0, 2), 0.5);  // between the last texel and the first of the next
}

}  // namespace
}  // namespace voxeld::reference
