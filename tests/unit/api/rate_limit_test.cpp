#include "server/api/access/rate_limit.h"

#include <gtest/gtest.h>

namespace voxeld::api {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(RateLimit, two_seconds_worth_may_come_at_once_and_comes_back_steadily) {
  RateLimiter limiter;
  const RateLimiter::Clock::time_point start{};
  for (int i = 0; i < 20; ++i) {
    const RateState state = limiter.take("lab", 600, start);
    ASSERT_TRUE(state.admitted) << i;
    EXPECT_EQ(state.burst, 20);
    EXPECT_EQ(state.window_s, 2);
    EXPECT_EQ(state.left, 19 - i);
  }
  const RateState refused = limiter.take("lab", 600, start);
  EXPECT_FALSE(refused.admitted);
  EXPECT_EQ(refused.left, 0);
  EXPECT_EQ(refused.reset_s, 2);
  EXPECT_EQ(refused.retry_s, 1);
  EXPECT_TRUE(limiter.take("studio", 600, start).admitted);
  EXPECT_TRUE(limiter.take("lab", 600, start + milliseconds(101)).admitted);
  EXPECT_FALSE(limiter.take("lab", 600, start + milliseconds(110)).admitted);
  EXPECT_EQ(limiter.take("lab", 600, start + seconds(60)).left, 19);
}

TEST(RateLimit, fewer_than_one_in_a_second_come_one_by_one) {
  RateLimiter limiter;
  const RateLimiter::Clock::time_point start{};
  EXPECT_TRUE(limiter.take("lab", 6, start).admitted);
  const RateState refused = limiter.take("lab", 6, start + seconds(4));
  EXPECT_FALSE(refused.admitted);
  EXPECT_EQ(refused.burst, 1);
  EXPECT_EQ(refused.window_s, 10);
  EXPECT_EQ(refused.retry_s, 6);
  EXPECT_TRUE(limiter.take("lab", 6, start + milliseconds(10'001)).admitted);
}

}  // namespace
}  // namespace voxeld::api
