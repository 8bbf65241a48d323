// Jobs that are preempted, by workers that the tests play.
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "server/jobs/scheduling/preemption.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using nlohmann::json;
using testing::FakeWorker;

class PreemptedJobs : public testing::ServiceTest {
 protected:
  JobStatus submit_with(int priority) {
    JobRequest request;
    request.asset = put_asset("mesh");
    request.options.use_cache = false;
    request.priority = priority;
    return submit(request);
  }
  JobStatus get(const std::string& id) { return service_->get(Caller::open(), id).value(); }

  // Reports until the gateway asks to preempt, or for longer than it takes to.
  static bool is_asked(FakeWorker& worker, const Task& task, bool is_preemptible) {
    TaskProgress progress{task.id, task.fence, "voxelize", 3, 8, 0, 0, {}, is_preemptible, 1};
    const auto until =
        Clock::now() + (is_preemptible ? testing::kPatience : std::chrono::seconds(2));
    while (Clock::now() < until) {
      const auto reply = worker.call(to_json_message(progress));
      if (!reply) return false;
      if (reply->value("preempt", false)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }
  static json preempt(FakeWorker& worker, const Task& task) {
    return worker
        .call(to_json_message(TaskPreemption{task.id, task.fence, 3, 8, {{"voxelize", 100}}}))
        .value_or(json::object());
  }
};

TEST_F(PreemptedJobs, go_on_later_without_an_attempt_that_counts) {
  FakeWorker worker = connect();
  const std::string id = submit_with(0).id;
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const std::string urgent = submit_with(5).id;
  const int64_t seen = get(id).version;
  ASSERT_TRUE(is_asked(worker, *task, true));
  EXPECT_EQ(preempt(worker, *task)["ok"], true);
  const JobStatus preempted = get(id);
  EXPECT_EQ(preempted.state, JobState::kQueued);
  EXPECT_EQ(std::pair(preempted.preempted, preempted.attempt), std::pair(1, 0));
  EXPECT_EQ(std::pair(preempted.tiles_done, preempted.tiles_total),
            std::pair(int64_t{3}, int64_t{8}));
  EXPECT_EQ(preempted.queue_position, 1);
  EXPECT_EQ(preempted.waiting_for, "a worker");
  EXPECT_GT(preempted.version, seen);

  const auto next = worker.claim();
  ASSERT_TRUE(next);
  EXPECT_EQ(next->id, urgent);
  EXPECT_TRUE(worker.complete(*next, "urgent"));
  const auto again = worker.claim();
  ASSERT_TRUE(again);
  EXPECT_EQ(again->id, id);
  EXPECT_GT(again->fence, task->fence);
  EXPECT_EQ(again->attempt, 1);
  EXPECT_EQ(get(id).tiles_done, 3) << "until it has told of tiles";
  worker.progress(*again, "voxelize", 4, 8);
  EXPECT_EQ(get(id).tiles_done, 4);
  EXPECT_TRUE(worker.complete(*again, "voxels"));
  const JobStatus done = wait_end(id);
  EXPECT_EQ(std::pair(done.state, done.preempted), std::pair(JobState::kDone, 1));
  double voxelize_ms = 0;
  for (const auto& [stage, ms] : done.timings) voxelize_ms += stage == "voxelize" ? ms : 0;
  EXPECT_GE(voxelize_ms, 100) << "of both attempts";
}

TEST_F(PreemptedJobs, are_only_those_whose_workers_report_that_they_can_stop) {
  FakeWorker worker = connect();
  submit_with(0);
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  submit_with(5);
  EXPECT_FALSE(is_asked(worker, *task, false));
  EXPECT_TRUE(worker.complete(*task, "voxels")) << "its connection still lives";
}

TEST_F(PreemptedJobs, were_asked_before) {
  FakeWorker worker = connect();
  const std::string id = submit_with(0).id;
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_FALSE(preempt(worker, *task).contains("ok"));
  FakeWorker other = connect();
  const auto again = other.claim();  // the first one's connection has ended
  ASSERT_TRUE(again);
  EXPECT_EQ(std::pair(again->id, again->attempt), std::pair(id, 2));
  Task late = *again;
  late.fence = task->fence;
  EXPECT_EQ(preempt(other, late)["fenced"], true);
}

TEST_F(PreemptedJobs, end_where_a_cancel_came_meanwhile_and_later) {
  FakeWorker worker = connect();
  const std::string first = submit_with(0).id;
  auto task = worker.claim();
  ASSERT_TRUE(task);
  const std::string urgent = submit_with(5).id;
  ASSERT_TRUE(is_asked(worker, *task, true));
  ASSERT_TRUE(service_->cancel(Caller::open(), first));
  EXPECT_EQ(preempt(worker, *task)["ok"], true);
  EXPECT_EQ(get(first).state, JobState::kCancelled);

  task = worker.claim();
  ASSERT_TRUE(task);
  submit_with(7);
  ASSERT_TRUE(is_asked(worker, *task, true));
  EXPECT_EQ(preempt(worker, *task)["ok"], true);
  EXPECT_EQ(get(urgent).state, JobState::kQueued);
  EXPECT_EQ(service_->cancel(Caller::open(), urgent)->state, JobState::kCancelled);
}

TEST_F(PreemptedJobs, are_queued_with_their_progress_after_a_restart) {
  std::string id;
  {
    FakeWorker worker = connect();
    id = submit_with(0).id;
    const auto task = worker.claim();
    ASSERT_TRUE(task);
    submit_with(5);
    ASSERT_TRUE(is_asked(worker, *task, true));
    EXPECT_EQ(preempt(worker, *task)["ok"], true);
    start();
  }
  const JobStatus status = get(id);
  EXPECT_EQ(std::pair(status.state, status.preempted), std::pair(JobState::kQueued, 1));
  EXPECT_EQ(status.tiles_done, 3);
  ASSERT_TRUE(status.estimate);
  EXPECT_GT(status.expected_end_ms, 0);
}

}  // namespace
}  // namespace voxeld
