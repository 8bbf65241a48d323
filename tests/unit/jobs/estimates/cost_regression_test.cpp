// Learned costs, and the forecast of the queue.
#include "server/jobs/estimates/cost_regression.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "server/jobs/estimates/forecast.h"

namespace voxeld {
namespace {

// Grows with the side and the bytes.
double true_factor(const CostFeatures& features) {
  return 3 * (features.side / 256.0) * std::pow(features.input_bytes / 1048576.0, 0.2);
}

TEST(CostRegression, begins_with_1_and_says_how_little_it_knows) {
  const CostRegression model;
  const CostRange range = model.predict({512, 1e7});
  EXPECT_NEAR(range.expected, 1, 1e-12);
  EXPECT_LT(range.low, 0.2);
  EXPECT_GT(range.high, 5);
}

TEST(CostRegression, learns_the_law_of_its_observations) {
  CostRegression model;
  uint64_t random = 1;
  const auto next = [&random] {
    random = random * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(random >> 40) / double{1 << 24};
  };
  for (int i = 0; i < 300; ++i) {
    const CostFeatures features{std::exp2(6 + 5 * next()), std::exp2(14 + 12 * next())};
    model.observe(features, true_factor(features) * (0.95 + 0.1 * next()));
  }
  EXPECT_EQ(model.observations(), 300);
  // Also where it has seen nothing: four times the largest.
  for (const double side : {100.0, 1024.0, 8192.0}) {
    const CostFeatures features{side, 5e6};
    const CostRange range = model.predict(features);
    EXPECT_NEAR(range.expected / true_factor(features), 1.0, 0.1) << side;
    EXPECT_LT(range.low, true_factor(features));
    EXPECT_GT(range.high, true_factor(features));
    EXPECT_LT(range.high / range.low, 2.0);
  }
}

TEST(CostRegression, forgets_a_machine_that_is_gone) {
  CostRegression model;
  const CostFeatures features{256, 1048576};
  for (int i = 0; i < 1000; ++i) model.observe(features, 5.0);
  for (int i = 0; i < 1000; ++i) model.observe(features, 0.5);
  EXPECT_NEAR(model.predict(features).expected, 0.5, 0.02);
}

TEST(CostRegression, leaves_nonsense_aside) {
  CostRegression model;
  for (const double factor : {0.0, -1.0, std::nan(""), HUGE_VAL}) model.observe({}, factor);
  EXPECT_EQ(model.observations(), 0);
}

TEST(CostRegression, is_read_back_as_it_was_written) {
  CostRegression model;
  for (int i = 1; i < 40; ++i) model.observe({16.0 * i, 1e5 * i}, 0.01 * i);
  CostRegression read;
  ASSERT_TRUE(read.parse(model.text()).ok());
  EXPECT_EQ(read.text(), model.text());
  EXPECT_EQ(read.predict({300, 1e6}).expected, model.predict({300, 1e6}).expected);
  for (const std::string text :
       {"", "1 2", "1 2 3 4 5 6 7 8 9 10 11 12 13 14 x", "-1 0 0 1 1 1 1 0 0 0 1 0 0 0 1",
        "1 0 0 1 1 1 0 0 0 0 0 0 0 0 0"}) {
    CostRegression other;
    EXPECT_FALSE(other.parse(text).ok()) << text;
    EXPECT_EQ(other.text(), CostRegression().text());
  }
}

TEST(Forecast, one_tenants_jobs_follow_on_each_other) {
  const auto times = forecast({{"a", 1, 3}, {"a", 1, 2, true}, {"a", 1, 1}}, 1);
  EXPECT_DOUBLE_EQ(times[1].end, 2);
  EXPECT_DOUBLE_EQ(times[0].start, 2);
  EXPECT_DOUBLE_EQ(times[0].end, 5);
  EXPECT_DOUBLE_EQ(times[2].end, 6);
}

TEST(Forecast, a_small_job_does_not_wait_for_a_giant_of_another_tenant) {
  const auto times = forecast({{"giant", 1, 300, true}, {"giant", 1, 300}, {"small", 1, 0.2}}, 1);
  EXPECT_DOUBLE_EQ(times[2].start, 0);
  EXPECT_DOUBLE_EQ(times[2].end, 0.4);
  EXPECT_DOUBLE_EQ(times[0].end, 300.2);
  EXPECT_DOUBLE_EQ(times[1].end, 600.2);
}

TEST(Forecast, weights_divide_the_device) {
  const auto times = forecast({{"a", 1, 10}, {"b", 4, 10}}, 1);
  EXPECT_DOUBLE_EQ(times[1].end, 12.5);
  EXPECT_DOUBLE_EQ(times[0].end, 20);
}

TEST(Forecast, a_tenant_has_one_device_at_most) {
  const auto alone = forecast({{"a", 1, 10}}, 4);
  EXPECT_DOUBLE_EQ(alone[0].end, 10);
  // The heavy one is full with one of two; the others share the second.
  const auto times = forecast({{"a", 100, 10}, {"b", 1, 10}, {"c", 1, 10}}, 2);
  EXPECT_DOUBLE_EQ(times[0].end, 10);
  EXPECT_DOUBLE_EQ(times[1].end, 15);
  EXPECT_DOUBLE_EQ(times[2].end, 15);
}

TEST(Forecast, nothing_to_do_takes_no_time) {
  EXPECT_TRUE(forecast({}, 1).empty());
  const auto times = forecast({{"a", 1, 0}, {"a", 1, 0}, {"b", 0, 1}}, 0);
  EXPECT_DOUBLE_EQ(times[1].end, 0);
  EXPECT_DOUBLE_EQ(times[2].end, 1);
}

}  // namespace
}  // namespace voxeld
