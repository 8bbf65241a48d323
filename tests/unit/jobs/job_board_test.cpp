#include "server/jobs/job_board.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace voxeld {
namespace {

using Clock = JobBoard::Clock;
using std::chrono::milliseconds;

JobStatus running_status(int64_t version) {
  JobStatus status;
  status.id = "j-1";
  status.state = JobState::kRunning;
  status.version = version;
  return status;
}

TEST(JobBoard, progress_raises_the_version_and_shows_in_the_status) {
  JobBoard board;
  board.start("j-1", 2);
  board.progress("j-1", "voxelize", 3, 8);
  JobStatus status = running_status(2);
  board.overlay(status);
  EXPECT_EQ(status.version, 3);
  EXPECT_EQ(status.stage, "voxelize");
  EXPECT_EQ(status.tiles_done, 3);
  EXPECT_EQ(status.tiles_total, 8);
  EXPECT_EQ(board.live_version("j-1"), 3);
}

TEST(JobBoard, reports_within_a_tenth_of_a_second_or_without_news_are_one_change) {
  JobBoard board;
  board.start("j-1", 2);
  for (int i = 1; i < 50; ++i) board.progress("j-1", "voxelize", i, 100);
  EXPECT_EQ(board.live_version("j-1"), 3);
  board.progress("j-1", "encode", 0, 0);  // another stage is always news
  EXPECT_EQ(board.live_version("j-1"), 4);
  std::this_thread::sleep_for(milliseconds(120));
  board.progress("j-1", "encode", 0, 0);
  EXPECT_EQ(board.live_version("j-1"), 4);
}

TEST(JobBoard, jobs_that_do_not_run_have_no_progress) {
  JobBoard board;
  board.progress("j-1", "voxelize", 1, 2);
  EXPECT_EQ(board.live_version("j-1"), 0);
  board.start("j-1", 2);
  board.changed("j-1", 3, false);
  board.progress("j-1", "voxelize", 1, 2);
  EXPECT_EQ(board.live_version("j-1"), 0);
  JobStatus status = running_status(2);
  board.overlay(status);
  EXPECT_EQ(status.version, 2);
}

TEST(JobBoard, a_watcher_wakes_at_the_change_and_not_before) {
  JobBoard board;
  JobBoard::Watch watch(board, "j-1");
  std::thread worker([&] {
    std::this_thread::sleep_for(milliseconds(30));
    board.start("j-1", 2);
  });
  watch.wait(1, Clock::now() + std::chrono::seconds(10));
  EXPECT_EQ(board.live_version("j-1"), 2);
  worker.join();
}

TEST(JobBoard, a_watcher_returns_at_its_deadline) {
  JobBoard board;
  JobBoard::Watch watch(board, "j-1");
  const auto start = Clock::now();
  watch.wait(1, start + milliseconds(50));
  EXPECT_GE(Clock::now() - start, milliseconds(50));
}

TEST(JobBoard, a_change_between_reading_and_waiting_is_not_missed) {
  JobBoard board;
  JobBoard::Watch watch(board, "j-1");
  board.changed("j-1", 5, false);
  const auto start = Clock::now();
  watch.wait(4, start + std::chrono::seconds(10));
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(5));
}

TEST(JobBoard, a_cancel_is_remembered_with_its_age) {
  JobBoard board;
  board.start("j-1", 2);
  EXPECT_LT(board.cancel_age_seconds("j-1"), 0);
  board.request_cancel("j-1");
  std::this_thread::sleep_for(milliseconds(20));
  board.request_cancel("j-1");  // again: the first one counts
  EXPECT_GE(board.cancel_age_seconds("j-1"), 0.02);
}

TEST(JobBoard, frames_are_counted_by_reports_and_by_what_is_listed) {
  JobBoard board;
  JobStatus status;
  status.id = "j-1";
  status.state = JobState::kRunning;
  board.start("j-1", 2);
  board.progress("j-1", "voxelize", 1, 8, 0, 5);
  EXPECT_EQ(board.live_version("j-1"), 3);
  board.frames_listed("j-1", 2);  // within the throttle: kept for the next report
  EXPECT_EQ(board.live_version("j-1"), 3);
  board.overlay(status);
  EXPECT_EQ(status.frames_done, 2);
  EXPECT_EQ(status.frames_total, 5);
  std::this_thread::sleep_for(std::chrono::milliseconds(120));
  board.progress("j-1", "voxelize", 1, 8, 2, 5);
  EXPECT_EQ(board.live_version("j-1"), 4);
  board.progress("j-1", "voxelize", 1, 8, 2, 5);  // known already
  EXPECT_EQ(board.live_version("j-1"), 4);
  std::this_thread::sleep_for(std::chrono::milliseconds(120));
  board.frames_listed("j-1", 3);
  EXPECT_EQ(board.live_version("j-1"), 5);
  board.start("j-1", 9);  // another attempt begins at none
  JobStatus again = status;
  again.frames_done = again.frames_total = 0;
  board.overlay(again);
  EXPECT_EQ(again.frames_done, 0);
}

}  // namespace
}  // namespace voxeld
