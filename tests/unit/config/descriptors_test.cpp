#include "server/descriptors.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

namespace voxeld {
namespace {

DescriptorPlan wanted(int64_t limit) {
  return {limit, 16384, 256, kAdminConnectionsMax, 64};
}

int64_t used(const DescriptorPlan& plan, int workers) {
  return kDescriptorsOfProcess + kDescriptorsOfWorker * workers + plan.admin_connections +
         kDescriptorsOfThread * plan.request_threads + kDescriptorsOfConnection * plan.connections;
}

TEST(FitDescriptors, grants_the_requested_counts_if_they_fit) {
  EXPECT_EQ(fit_descriptors(wanted(65536), 3).value(), wanted(65536));
}

TEST(FitDescriptors, never_exceeds_the_limit_and_reserves_the_descriptors_of_jobs) {
  int fitting = 0;
  for (int64_t limit = 200; limit < 40'000; limit += 37) {
    for (const int workers : {1, 3, 8}) {
      const auto plan = fit_descriptors(wanted(limit), workers);
      if (!plan) continue;
      ++fitting;
      EXPECT_LE(used(*plan, workers), limit);
      EXPECT_GE(plan->connections, kConnectionsMin) << limit;
      EXPECT_GE(plan->request_threads, kRequestThreadsMin) << limit;
      EXPECT_LE(plan->connections_per_address, std::max(1, plan->connections / 2)) << limit;
    }
  }
  EXPECT_GT(fitting, 3000);  // of 3228
  const auto small = fit_descriptors(wanted(256), 3);
  ASSERT_TRUE(small);
  EXPECT_EQ(small->request_threads, 14);
  EXPECT_EQ(small->connections, 28);
  EXPECT_EQ(small->connections_per_address, 14);
}

TEST(FitDescriptors, any_number_of_one_address_stays_any_number) {
  DescriptorPlan plan = wanted(256);
  plan.connections_per_address = 0;
  EXPECT_EQ(fit_descriptors(plan, 3)->connections_per_address, 0);
}

TEST(FitDescriptors, too_low_a_limit_is_refused_with_the_one_that_is_needed) {
  EXPECT_EQ(fit_descriptors(wanted(64), 3).error().message(),
            "limit on open files (ulimit -n): expected at least 144 for 3 workers, got 64");
  EXPECT_FALSE(fit_descriptors(wanted(144), 3)) << "of more, more is set aside for the admin port";
  EXPECT_TRUE(fit_descriptors(wanted(160), 3));
}

TEST(ShareOutDescriptors, few_connections_that_fit_are_no_matter_of_the_limit_on_open_files) {
  ::testing::internal::CaptureStderr();
  const auto plan = share_out_descriptors({0, 16, 256, 1, 4}, 1);
  const std::string log = ::testing::internal::GetCapturedStderr();
  ASSERT_TRUE(plan) << plan.error().message();
  EXPECT_EQ(plan->connections, 16);
  EXPECT_EQ(plan->connections_per_address, 8);
  EXPECT_EQ(log.find("too low"), std::string::npos) << log;
}

}  // namespace
}  // namespace voxeld
