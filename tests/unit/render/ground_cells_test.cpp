#include "server/render/cpu/ground_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace voxeld {
namespace {

constexpr int kWidth = 61;  // no multiple of a cell

using Darkness = std::function<float(int, int)>;

struct Found {
  int asked = 0;         // how many values
  float difference = 0;  // the largest from the function
};

Found find(const Darkness& darkness, const std::function<bool(int, int)>& is_wanted) {
  GroundCells cells(kWidth);
  cells.begin();
  for (int row = 0; row < GroundCells::kSide; ++row) {
    for (int x = 0; x < kWidth; ++x) {
      if (is_wanted(x, row)) cells.want(x, row);
    }
  }
  Found found;
  cells.find([&](int x, int row) {
    ++found.asked;
    return darkness(x, row);
  });
  for (int row = 0; row < GroundCells::kSide; ++row) {
    for (int x = 0; x < kWidth; ++x) {
      if (!is_wanted(x, row)) continue;
      const float difference = std::abs(cells.value(x, row) - darkness(x, row));
      found.difference = std::max(found.difference, difference);
    }
  }
  return found;
}

bool everywhere(int, int) {
  return true;
}

TEST(GroundCells, corners_and_the_middle_are_enough_where_it_is_even) {
  for (const float value : {0.0f, 0.4f}) {
    const Found found = find([&](int, int) { return value; }, everywhere);
    EXPECT_EQ(found.asked, 9 * 2 + 8);
    EXPECT_EQ(found.difference, 0.0f);
  }
}

TEST(GroundCells, a_slope_is_interpolated) {
  const Found found =
      find([](int x, int row) { return 0.2f + 0.0002f * static_cast<float>(x + row); }, everywhere);
  EXPECT_EQ(found.asked, 9 * 2 + 8);
  EXPECT_LT(found.difference, 1e-6f);
}

TEST(GroundCells, steps_are_off_by_no_more_than_those_of_a_ray) {
  constexpr float kRay = 0.0175f;
  const auto stairs = [&](int x, int row) {
    return 0.1f + kRay * std::floor(static_cast<float>(x + 2 * row) / 7.0f);
  };
  const Found found = find(stairs, everywhere);
  EXPECT_LE(found.difference, GroundCells::same(2));
  EXPECT_LT(found.asked, kWidth * GroundCells::kSide / 2);
}

TEST(GroundCells, an_edge_stays_sharp) {
  const auto edge = [](int x, int row) { return x + row < 30 ? 0.9f : 0.1f; };
  EXPECT_EQ(find(edge, everywhere).difference, 0.0f);
}

TEST(GroundCells, what_has_no_shadow_stays_without) {
  const auto fading = [](int x, int) {
    return std::max(0.0f, 0.0001f * static_cast<float>(x - 30));
  };
  GroundCells cells(kWidth);
  cells.begin();
  for (int row = 0; row < GroundCells::kSide; ++row) {
    for (int x = 0; x < kWidth; ++x) cells.want(x, row);
  }
  cells.find(fading);
  for (int x = 0; x <= 30; ++x) EXPECT_EQ(cells.value(x, 3), 0.0f) << x;
  EXPECT_GT(cells.value(kWidth - 1, 3), 0.0f);
}

TEST(GroundCells, cells_in_which_nothing_is_wanted_cost_nothing) {
  EXPECT_EQ(find([](int, int) { return 0.5f; }, [](int, int) { return false; }).asked, 0);
  // One pixel, in the cell from 16 to 24.
  EXPECT_EQ(
      find([](int, int) { return 0.5f; }, [](int x, int row) { return x == 17 && row == 2; }).asked,
      5);
}

}  // namespace
}  // namespace voxeld
