// The oracle itself, checked against cases that a person can work out.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/reference/color_oracle.h"
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

}  // namespace
}  // namespace voxeld::reference
