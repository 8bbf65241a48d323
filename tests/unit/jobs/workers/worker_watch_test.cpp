#include "server/jobs/workers/worker_watch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/process/machine.h"
#include "tests/unit/base/comes_true.h"

namespace voxeld {
namespace {

// Runs a watch until it has looked at the workers once at least.
void watch_once(WatchLimits limits, const std::vector<WatchedWorker>& workers,
                WorkerWatch::Calls calls) {
  std::atomic<int> looks = 0;
  calls.workers = [&] {
    ++looks;
    return workers;
  };
  const WorkerWatch watch(limits, std::move(calls));
  // The second one begins when the first has ended.
  EXPECT_TRUE(testing::comes_true([&] { return looks >= 2; }));
}

// The verdicts of the watch on this very process as a worker.
std::vector<std::pair<std::string, Error>> verdicts(WatchLimits limits, const WatchedWorker& worker,
                                                    int64_t* bytes = nullptr) {
  std::vector<std::pair<std::string, Error>> told;
  watch_once(limits, {worker},
             {.workers = nullptr,
              .measured =
                  [&](const WatchedWorker&, int64_t measured) {
                    if (bytes != nullptr) *bytes = measured;
                  },
              .condemned = [&](const WatchedWorker& one,
                               const Error& error) { told.emplace_back(one.task, error); },
              .displaced =
                  [](const WatchedWorker& one, const WorkerLoss&) {
                    ADD_FAILURE() << one.task << ": all of them have no limit";
                  },
              .silent = nullptr});
  return told;
}

TEST(WorkerWatch, a_worker_within_its_limits_is_measured_and_left_alone) {
  int64_t bytes = 0;
  EXPECT_TRUE(verdicts({.memory_bytes_max = int64_t{1} << 40, .job_seconds_max = 100},
                       {.pid = ::getpid(), .task = "j-1", .task_seconds = 1}, &bytes)
                  .empty());
  EXPECT_GT(bytes, 100'000);
  EXPECT_LT(bytes, resident_bytes() * 2);
}

// Which of them the watch ends where all are this very process.
struct Displaced {
  std::string task;
  WorkerLoss loss;
};
std::vector<Displaced> displaced(WatchLimits limits, const std::vector<WatchedWorker>& workers) {
  std::vector<Displaced> told;
  watch_once(
      limits, workers,
      {.workers = nullptr,
       .measured = [](const WatchedWorker&, int64_t) {},
       .condemned = [](const WatchedWorker& one,
                       const Error& error) { EXPECT_EQ(one.task, "long") << error.message(); },
       .displaced =
           [&](const WatchedWorker& one, const WorkerLoss& loss) {
             told.push_back({one.task, loss});
           },
       .silent = nullptr});
  return told;
}

TEST(WorkerWatch, over_the_total_the_worker_furthest_beyond_its_request_is_ended) {
  const int64_t pid = ::getpid();
  constexpr int64_t kMuch = int64_t{1} << 40, kSome = int64_t{1} << 30;
  const std::vector<WatchedWorker> workers{
      {.pid = pid, .task = "granted", .task_seconds = 1, .asked_bytes = kMuch},
      {.pid = pid, .task = "reads", .task_seconds = 1, .asked_bytes = 0},
      {.pid = pid, .task = "grew", .task_seconds = 1, .asked_bytes = kSome}};
  const auto told = displaced({.all_memory_bytes_max = 1}, workers);
  ASSERT_FALSE(told.empty());
  for (const Displaced& one : told) EXPECT_EQ(one.task, "reads") << "one at each look";
  const WorkerLoss& loss = told[0].loss;
  EXPECT_TRUE(loss.reason.starts_with("memory of all workers: ")) << loss.reason;
  EXPECT_TRUE(loss.reason.ends_with(" and had asked for 0 MB")) << loss.reason;
  EXPECT_TRUE(loss.counts) << "it exceeds the total by itself";
  const auto together = displaced({.all_memory_bytes_max = 5 * private_bytes(pid) / 2}, workers);
  ASSERT_FALSE(together.empty());
  EXPECT_FALSE(together[0].loss.counts);
  EXPECT_GT(together[0].loss.displaced_bytes, 100'000);
  EXPECT_LT(together[0].loss.displaced_bytes, kSome);
  EXPECT_TRUE(displaced({.all_memory_bytes_max = kMuch}, workers).empty());
  EXPECT_TRUE(displaced({}, workers).empty());
}

TEST(WorkerWatch, a_job_that_was_displaced_before_has_an_attempt_less_where_it_was_granted_memory) {
  const int64_t pid = ::getpid();
  constexpr int64_t kMuch = int64_t{1} << 40;
  for (const int64_t asked_bytes : {0, 1}) {
    const std::vector<WatchedWorker> workers{{.pid = pid, .task = "other", .asked_bytes = kMuch},
                                             {.pid = pid,
                                              .task = "again",
                                              .asked_bytes = asked_bytes,
                                              .needed_bytes = kMuch,
                                              .was_displaced = true}};
    const auto told = displaced({.all_memory_bytes_max = 3 * private_bytes(pid) / 2}, workers);
    ASSERT_FALSE(told.empty());
    EXPECT_EQ(told[0].task, "again");
    EXPECT_EQ(told[0].loss.counts, asked_bytes > 0);
    EXPECT_EQ(told[0].loss.displaced_bytes, kMuch);
  }
}

TEST(WorkerWatch, a_job_that_exceeds_the_total_alone_is_told_so) {
  const int64_t pid = ::getpid();
  const auto told = displaced({.all_memory_bytes_max = 1},
                              {{.pid = pid, .task = "reads", .task_seconds = 1},
                               {.pid = pid, .task = "", .asked_bytes = int64_t{1} << 40}});
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told[0].task, "reads");
  EXPECT_TRUE(told[0].loss.counts);
}

TEST(WorkerWatch, a_worker_that_is_ended_anyway_does_not_count_towards_the_total) {
  const int64_t pid = ::getpid();
  const auto told =
      displaced({.all_memory_bytes_max = 3 * private_bytes(pid) / 2, .job_seconds_max = 9},
                {{.pid = pid, .task = "long", .task_seconds = 10},
                 {.pid = pid, .task = "other", .task_seconds = 1}});
  EXPECT_TRUE(told.empty());
}

TEST(WorkerWatch, too_much_memory_ends_the_job_with_the_numbers) {
  const auto told =
      verdicts({.memory_bytes_max = 1}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 1});
  ASSERT_GE(told.size(), 1u);
  EXPECT_EQ(told[0].first, "j-1");
  EXPECT_EQ(told[0].second.code, ErrorCode::kGridTooLarge);
  EXPECT_TRUE(told[0].second.detail.starts_with("memory: ")) << told[0].second.detail;
  EXPECT_TRUE(told[0].second.detail.ends_with(" MB, limit 0 MB")) << told[0].second.detail;
}

TEST(WorkerWatch, too_long_a_job_ends) {
  const auto told =
      verdicts({.job_seconds_max = 10}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 12.4});
  ASSERT_GE(told.size(), 1u);
  EXPECT_EQ(told[0].second.code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(told[0].second.message(), "the job ran too long: expected at most 10 s, got 12.4 s");
  EXPECT_TRUE(verdicts({.job_seconds_max = 10}, {.pid = ::getpid(), .task = "", .task_seconds = 12})
                  .empty());
  EXPECT_TRUE(verdicts({}, {.pid = ::getpid(), .task = "j-1", .task_seconds = 1e9}).empty());
}

TEST(WorkerWatch, a_process_that_is_gone_takes_nothing) {
  EXPECT_TRUE(
      verdicts({.memory_bytes_max = 1}, {.pid = 999'999'999, .task = "j-1", .task_seconds = 1})
          .empty());
}

TEST(HostMemory, the_machine_has_a_limit_and_bytes_read_well) {
  EXPECT_GT(memory_limit_bytes(), int64_t{64} << 20);
  EXPECT_EQ(memory_text(9'120'000'000), "9.1 GB");
  EXPECT_EQ(memory_text(312'400'000), "312 MB");
}

TEST(WorkerWatch, a_silent_worker_is_reported_while_it_has_a_task) {
  std::vector<std::string> silent;
  const int64_t pid = ::getpid();
  watch_once({.silent_seconds_max = 2},
             {{.pid = pid, .task = "silent", .silent_seconds = 2.1},
              {.pid = pid, .task = "at work", .silent_seconds = 0.3},
              {.pid = pid, .task = "", .silent_seconds = 50}},
             {.workers = nullptr,
              .measured = [](const WatchedWorker&, int64_t) {},
              .condemned = nullptr,
              .displaced = nullptr,
              .silent = [&](const WatchedWorker& one) { silent.push_back(one.task); }});
  ASSERT_FALSE(silent.empty());
  EXPECT_EQ(std::set<std::string>(silent.begin(), silent.end()), std::set<std::string>{"silent"});
}

}  // namespace
}  // namespace voxeld
