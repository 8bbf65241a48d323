#include "server/worker/task/cancel_watch.h"

#include <gtest/gtest.h>

#include <ctime>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

namespace voxeld {
namespace {

double thread_cpu_ms() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) * 1e3 + static_cast<double>(used.tv_nsec) / 1e6;
}

class CancelWatchTest : public ::testing::Test {
 protected:
  CancelWatch watch(const std::string& stage) const {
    return CancelWatch(
        scope_, [stage] { return stage; }, [] {});
  }
  const std::atomic<bool> flag_{false};
  const CancelScope scope_{flag_};
};

TEST_F(CancelWatchTest, work_without_a_point_counts_while_it_lasts) {
  const CancelWatch watch = this->watch("parse");
  const auto hung = std::chrono::steady_clock::now() + std::chrono::minutes(5);
  while (watch.longest().ms < 100 && std::chrono::steady_clock::now() < hung) {
  }
  EXPECT_GE(watch.longest().ms, 100);
  EXPECT_EQ(watch.longest().stage, "parse");
}

TEST_F(CancelWatchTest, work_with_points_does_not_count) {
  const CancelWatch watch = this->watch("parse");
  for (const double end = thread_cpu_ms() + 300; thread_cpu_ms() < end;) cancel_point();
  EXPECT_LT(watch.longest().ms, CancelWatch::kDistanceMsMax);
}

TEST_F(CancelWatchTest, waiting_does_not_count) {
  const CancelWatch watch = this->watch("parse");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_LT(watch.longest().ms, CancelWatch::kDistanceMsMax);
}

}  // namespace
}  // namespace voxeld
