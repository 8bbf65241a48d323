#include "server/jobs/events/job_board.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <vector>

namespace voxeld {
namespace {

using std::chrono::milliseconds;

JobStatus running_status(int64_t version) {
  JobStatus status;
  status.id = "j-1";
  status.state = JobState::kRunning;
  status.version = version;
  return status;
}

// A board whose clock the test moves.
class JobBoardTest : public ::testing::Test {
 protected:
  void pass(milliseconds time) { now_ += time; }

  JobBoard::Clock::time_point now_{std::chrono::hours(1)};
  JobBoard board_{[this] { return now_; }};
};

TEST_F(JobBoardTest, progress_raises_the_version_and_shows_in_the_status) {
  board_.start("j-1", 2);
  board_.progress("j-1", "voxelize", 3, 8);
  JobStatus status = running_status(2);
  board_.overlay(status);
  EXPECT_EQ(status.version, 3);
  EXPECT_EQ(status.stage, "voxelize");
  EXPECT_EQ(status.tiles_done, 3);
  EXPECT_EQ(status.tiles_total, 8);
  EXPECT_EQ(board_.live_version("j-1"), 3);
}

TEST_F(JobBoardTest, reports_within_a_tenth_of_a_second_or_without_news_are_one_change) {
  board_.start("j-1", 2);
  for (int i = 1; i < 50; ++i) {
    board_.progress("j-1", "voxelize", i, 100);
    pass(milliseconds(2));
  }
  EXPECT_EQ(board_.live_version("j-1"), 3);
  board_.progress("j-1", "encode", 0, 0);  // another stage is always news
  EXPECT_EQ(board_.live_version("j-1"), 4);
  pass(milliseconds(120));
  board_.progress("j-1", "encode", 0, 0);
  EXPECT_EQ(board_.live_version("j-1"), 4);
}

TEST_F(JobBoardTest, jobs_that_do_not_run_have_no_progress) {
  board_.progress("j-1", "voxelize", 1, 2);
  EXPECT_EQ(board_.live_version("j-1"), 0);
  board_.start("j-1", 2);
  board_.changed("j-1", 3, false);
  board_.progress("j-1", "voxelize", 1, 2);
  EXPECT_EQ(board_.live_version("j-1"), 0);
  JobStatus status = running_status(2);
  board_.overlay(status);
  EXPECT_EQ(status.version, 2);
}

// Counts its wakes.
class CountingWaker final : public Waker {
 public:
  void wake() override { ++wakes; }
  std::atomic<int> wakes{0};
};

TEST_F(JobBoardTest, a_watcher_is_woken_by_each_change_until_it_ends) {
  const auto waker = std::make_shared<CountingWaker>();
  auto watch = board_.watch("j-1", JobChange::kAny, waker);
  EXPECT_EQ(waker->wakes, 0);
  board_.start("j-1", 2);
  EXPECT_EQ(waker->wakes, 1);
  board_.progress("j-1", "parse", 0, 0);
  EXPECT_EQ(waker->wakes, 2);
  board_.changed("j-2", 5, false);
  EXPECT_EQ(waker->wakes, 2) << "another job's change";
  watch.reset();
  board_.changed("j-1", 5, false);
  EXPECT_EQ(waker->wakes, 2);
  EXPECT_EQ(waker.use_count(), 1);
}

TEST_F(JobBoardTest, a_watcher_of_states_is_not_woken_by_progress) {
  const auto waker = std::make_shared<CountingWaker>();
  const auto watch = board_.watch("j-1", JobChange::kState, waker);
  board_.start("j-1", 2);
  board_.progress("j-1", "parse", 0, 0);
  EXPECT_EQ(waker->wakes, 0);
  board_.changed("j-1", 5, false);
  EXPECT_EQ(waker->wakes, 1);
}

TEST_F(JobBoardTest, reports_become_rarer_with_many_watchers) {
  std::vector<std::unique_ptr<JobWatch>> watches;
  for (int i = 0; i < 5000; ++i) {
    watches.push_back(board_.watch("j-1", JobChange::kAny, std::make_shared<CountingWaker>()));
  }
  board_.start("j-1", 2);
  board_.progress("j-1", "voxelize", 1, 8);
  pass(milliseconds(120));
  board_.progress("j-1", "voxelize", 2, 8);
  EXPECT_EQ(board_.live_version("j-1"), 3);
  watches.resize(1);
  board_.progress("j-1", "voxelize", 3, 8);
  EXPECT_EQ(board_.live_version("j-1"), 4);
}

TEST_F(JobBoardTest, a_cancel_is_remembered_with_its_age) {
  board_.start("j-1", 2);
  EXPECT_LT(board_.cancel_age_seconds("j-1"), 0);
  board_.request_cancel("j-1");
  pass(milliseconds(250));
  board_.request_cancel("j-1");  // again: the first one counts
  EXPECT_EQ(board_.cancel_age_seconds("j-1"), 0.25);
}

TEST_F(JobBoardTest, an_attempt_that_is_told_to_have_ended_late_does_not_end_the_next_one) {
  board_.start("j-1", 2);
  board_.start("j-1", 4);  // another worker has claimed it since it was put back as version 3
  board_.changed("j-1", 3, false);
  EXPECT_EQ(board_.live_version("j-1"), 4);
  board_.request_cancel("j-1");
  EXPECT_EQ(board_.cancel_age_seconds("j-1"), 0);
  board_.changed("j-1", 5, false);
  EXPECT_EQ(board_.live_version("j-1"), 0);
}

TEST_F(JobBoardTest, frames_are_counted_by_reports_and_by_listings) {
  JobStatus status;
  status.id = "j-1";
  status.state = JobState::kRunning;
  board_.start("j-1", 2);
  board_.progress("j-1", "voxelize", 1, 8, 0, 5);
  EXPECT_EQ(board_.live_version("j-1"), 3);
  board_.frames_listed("j-1", 2);  // within the throttle: deferred to the next report
  EXPECT_EQ(board_.live_version("j-1"), 3);
  board_.overlay(status);
  EXPECT_EQ(status.frames_done, 2);
  EXPECT_EQ(status.frames_total, 5);
  pass(milliseconds(120));
  board_.progress("j-1", "voxelize", 1, 8, 2, 5);
  EXPECT_EQ(board_.live_version("j-1"), 4);
  board_.progress("j-1", "voxelize", 1, 8, 2, 5);  // known already
  EXPECT_EQ(board_.live_version("j-1"), 4);
  pass(milliseconds(120));
  board_.frames_listed("j-1", 3);
  EXPECT_EQ(board_.live_version("j-1"), 5);
  board_.start("j-1", 9);  // another attempt begins at none
  JobStatus again = status;
  again.frames_done = again.frames_total = 0;
  board_.overlay(again);
  EXPECT_EQ(again.frames_done, 0);
}

TEST_F(JobBoardTest, kept_tiles_wake_those_who_watch_progress) {
  board_.tiles_kept("j-1");  // of a job that does not run
  board_.start("j-1", 2);
  const auto waker = std::make_shared<CountingWaker>();
  const auto watch = board_.watch("j-1", JobChange::kAny, waker);
  board_.progress("j-1", "voxelize", 0, 8);
  EXPECT_EQ(waker->wakes, 1);
  pass(milliseconds(120));
  board_.tiles_kept("j-1");
  EXPECT_EQ(waker->wakes, 2);
  board_.tiles_kept("j-1");  // within the throttle: deferred to the next report
  EXPECT_EQ(waker->wakes, 2);
  pass(milliseconds(120));
  board_.progress("j-1", "voxelize", 0, 8);
  EXPECT_EQ(waker->wakes, 3);
}

}  // namespace
}  // namespace voxeld
