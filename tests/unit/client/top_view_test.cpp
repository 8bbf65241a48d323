#include "client/cli/commands/top_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace voxeld::cli {
namespace {

using client::Queue;
using client::QueuedJob;
using std::chrono::seconds;

constexpr int64_t kNow = 1'700'000'000'000;  // 22:13:20 UTC

QueuedJob job(const std::string& id, const std::string& state) {
  QueuedJob one;
  one.job.id = id;
  one.job.kind = "voxelize";
  one.job.state = state;
  one.tenant = "lab";
  one.created_ms = kNow - 90'000;
  one.started_ms = kNow - 30'000;
  return one;
}

Queue sample() {
  Queue queue;
  queue.running = 2;
  queue.queued = 3;
  queue.others_queued = 1;
  queue.devices = {{"egl:0", "NVIDIA H200", 2, 2, {"j-run"}}, {"cpu", "", 0, 0, {}}};
  QueuedJob running = job("j-run", "running");
  running.device = "egl:0";
  running.job.stage = "voxelize";
  running.job.tiles_done = 4;
  running.job.tiles_total = 64;
  queue.jobs = {running, job("j-first", "queued"), job("j-second", "queued")};
  queue.jobs[1].job.queue_position = 1;
  queue.jobs[2].job.queue_position = 3;
  return queue;
}

TEST(TopView, devices_with_their_jobs_stand_above_the_queue) {
  TopView view("http://host:8080");
  const auto at = TopView::Clock::now();
  Queue queue = sample();
  view.lines(queue, {}, kNow, at);
  queue.jobs[0].job.tiles_done = 9;
  const std::vector<std::string> lines = view.lines(queue, {}, kNow, at + seconds(2));
  const std::vector<std::string> expected = {
      "voxel top  http://host:8080  22:13:20Z  running 2  queued 3 (1 of others)",
      "",
      "DEVICE       BUSY  RENDERER",
      "egl:0        2/2   NVIDIA H200",
      "  j-run        lab            voxelize  30s  voxelize  9/64 tiles 2.5/s",
      "  1 of others",
      "cpu          down  ",
      "",
      "  POS JOB          TENANT         KIND      STATE    AGE",
      "    1 j-first      lab            voxelize  queued   90s",
      "    3 j-second     lab            voxelize  queued   90s"};
  EXPECT_EQ(lines, expected);
}

TEST(TopView, a_preempted_job_shows_its_progress) {
  TopView view("http://host:8080");
  Queue queue = sample();
  queue.jobs[1].job.tiles_done = 9;
  queue.jobs[1].job.tiles_total = 64;
  const auto lines = view.lines(queue, {}, kNow, TopView::Clock::now());
  EXPECT_EQ(lines[lines.size() - 2],
            "    1 j-first      lab            voxelize  queued   90s preempted at 9/64");
}

TEST(TopView, it_fits_into_a_small_terminal) {
  TopView view("http://host:8080");
  const auto lines = view.lines(sample(), {30, 8}, kNow, TopView::Clock::now());
  EXPECT_EQ(lines.size(), 8u);
  EXPECT_EQ(lines.back(), "  ... 4 more lines");
  EXPECT_TRUE(std::ranges::all_of(lines, [](const auto& line) { return line.size() <= 30; }));
}

TEST(TopView, names_cannot_steer_the_terminal) {
  Queue queue = sample();
  queue.devices[0].renderer = "evil\x1b[2J\x9b\n";
  queue.jobs[1].tenant = "a\r\x1b]0;title\x07";
  TopView view("http://host\x1b[31m");
  for (const std::string& line : view.lines(queue, {}, kNow, TopView::Clock::now())) {
    EXPECT_TRUE(std::ranges::all_of(line, [](char c) { return c >= 0x20 && c < 0x7f; })) << line;
  }
}

TEST(TopView, the_same_response_shown_again_leaves_the_rate_and_a_new_stage_has_none) {
  TopView view("");
  const auto at = TopView::Clock::now();
  Queue queue = sample();
  view.lines(queue, {}, kNow, at);
  queue.jobs[0].job.tiles_done = 8;
  view.lines(queue, {}, kNow, at + seconds(1));
  EXPECT_NE(view.lines(queue, {}, kNow, at + seconds(1))[4].find("4.0/s"), std::string::npos);
  queue.jobs[0].job.stage = "encode";
  EXPECT_EQ(view.lines(queue, {}, kNow, at + seconds(2))[4].find("/s"), std::string::npos);
}

}  // namespace
}  // namespace voxeld::cli
