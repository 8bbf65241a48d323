#include "server/formats/npy/extend_sign.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

TEST(ExtendSign, a_row_takes_the_sign_of_what_it_borders_on) {
  std::vector<float> row = {kUnknown, kUnknown, 1.5F, -0.5F, kUnknown, -1.0F, 2.0F, kUnknown};
  extend_sign(row, {1, 1, row.size()}, 3);
  EXPECT_EQ(row, (std::vector<float>{3, 3, 1.5F, -0.5F, -3, -1.0F, 2.0F, 3}));
}

TEST(ExtendSign, without_a_value_all_stays_unknown) {
  std::vector<float> values(24, kUnknown);
  extend_sign(values, {2, 3, 4}, 2);
  EXPECT_TRUE(std::ranges::all_of(values, [](float value) { return std::isnan(value); }));
}

// The distance to a sphere, known in a band alone; planes and rows without it at the ends and, in
// the hollow, between.
TEST(ExtendSign, inside_and_outside_of_a_sphere_are_told_apart_along_every_axis) {
  const std::array<size_t, 3> sides = {37, 29, 33};
  std::vector<float> values, exact;
  for (size_t a = 0; a < sides[0]; ++a) {
    for (size_t b = 0; b < sides[1]; ++b) {
      for (size_t c = 0; c < sides[2]; ++c) {
        const double x = static_cast<double>(a) - 19, y = static_cast<double>(b) - 13,
                     z = static_cast<double>(c) - 15;
        exact.push_back(static_cast<float>(std::sqrt(x * x + y * y + z * z) - 9.3));
        values.push_back(std::abs(exact.back()) <= 1 ? exact.back() : kUnknown);
      }
    }
  }
  extend_sign(values, sides, 1);
  for (size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(values[i], std::clamp(exact[i], -1.0F, 1.0F)) << i;
  }
}

TEST(ExtendSign, a_cancelled_task_ends) {
  std::vector<float> values(64, 1.0F);
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  EXPECT_THROW(extend_sign(values, {4, 4, 4}, 2), Cancelled);
}

}  // namespace
}  // namespace voxeld
