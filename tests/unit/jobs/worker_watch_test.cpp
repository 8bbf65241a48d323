#include "server/jobs/worker_watch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <thread>
#include <utility>

#include "server/base/host_memory.h"

namespace voxeld {
namespace {

// What becomes of this very process as a worker.
std::vector<std::pair<std::string, Error>> verdicts(WatchLimits limits, const WatchedWorker& worker,
                                                    int64_t* bytes = nullptr) {
  Mutex mutex;
  std::vector<std::pair<std::string, Error>> told;
  {
    WorkerWatch watch(limits, {[&] { return std::vector{worker}; },
                               [&](const WatchedWorker&, int64_t measured) {
                                 MutexLock lock(mutex);
                                 if (bytes != nullptr) *bytes = measured;
                               },
                               [&](const WatchedWorker& one, const Error& error) {
                                 MutexLock lock(mutex);
                                 told.emplace_back(one.task, error);
                               }});
    std::this_thread::sleep_for(WorkerWatch::kPeriod / 2);
  }
  return told;
}

TEST(WorkerWatch, a_worker_within_its_limits_is_measured_and_left_alone) {
  int64_t bytes = 0;
  EXPECT_TRUE(verdicts({int64_t{1} << 40, 100},
                       {.pid = ::getpid(), .task = "j-1", .task_seconds = 1}, &bytes)
                  .empty());
  EXPECT_GT(bytes, 100'000);
  EXPECT_LT(bytes, resident_bytes() * 2);
}

TEST(WorkerWatch, too_much_memory_ends_the_job_with_the_numbers) {
  const auto told = verdicts({1, 0}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 1});
  ASSERT_GE(told.size(), 1u);
  EXPECT_EQ(told[0].first, "j-1");
  EXPECT_EQ(told[0].second.code, ErrorCode::kGridTooLarge);
  EXPECT_TRUE(told[0].second.detail.starts_with("memory: ")) << told[0].second.detail;
  EXPECT_TRUE(told[0].second.detail.ends_with(" MB, limit 0 MB")) << told[0].second.detail;
}

TEST(WorkerWatch, too_long_a_job_ends) {
  const auto told = verdicts({0, 10}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 12.4});
  ASSERT_GE(told.size(), 1u);
  EXPECT_EQ(told[0].second.code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(told[0].second.message(), "the job ran too long: expected at most 10 s, got 12 s");
  EXPECT_TRUE(verdicts({0, 10}, {.pid = ::getpid(), .task = "", .task_seconds = 12}).empty());
  EXPECT_TRUE(verdicts({0, 0}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 1e9}).empty());
}

TEST(WorkerWatch, a_process_that_is_gone_takes_nothing) {
  EXPECT_TRUE(verdicts({1, 0}, {.pid = 999'999'999, .task = "j-1", .task_seconds = 1}).empty());
}

TEST(HostMemory, the_machine_has_a_limit_and_bytes_read_well) {
  EXPECT_GT(memory_limit_bytes(), int64_t{64} << 20);
  EXPECT_EQ(memory_text(9'120'000'000), "9.1 GB");
  EXPECT_EQ(memory_text(312'400'000), "312 MB");
}

}  // namespace
}  // namespace voxeld
