#include "server/jobs/model/tenant_limits.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

TEST(TenantLimits, rates_are_per_second_or_per_minute) {
  EXPECT_EQ(parse_rate("10").value(), 600);
  EXPECT_EQ(parse_rate("10/s").value(), 600);
  EXPECT_EQ(parse_rate("30/m").value(), 30);
  EXPECT_EQ(parse_rate("0").value(), 0);
  for (const char* text : {"", "/s", "-1", "1/h", "1.5", "10/s ", "1000001/s", "60000001/m", "x"}) {
    const auto rate = parse_rate(text);
    ASSERT_FALSE(rate) << text;
    EXPECT_EQ(rate.error().code, ErrorCode::kInvalidOption);
    EXPECT_NE(rate.error().message().find("30/m"), std::string::npos);
  }
}

TEST(TenantLimits, a_rate_is_written_as_it_can_be_read) {
  for (const int64_t rate : {0, 1, 30, 60, 90, 600}) {
    const std::string text = rate_text(rate);
    EXPECT_EQ(rate == 0 ? 0 : parse_rate(text).value(), rate) << text;
  }
  EXPECT_EQ(rate_text(0), "-");
  EXPECT_EQ(rate_text(600), "10/s");
  EXPECT_EQ(rate_text(90), "90/m");
}

}  // namespace
}  // namespace voxeld
