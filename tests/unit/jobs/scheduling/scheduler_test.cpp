// Which job is claimed, and which worker gets it.
#include "server/jobs/records/job_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "server/base/clock.h"
#include "server/jobs/scheduling/slots.h"
#include "tests/unit/jobs/lists.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;

std::optional<size_t> pick(const std::vector<QueueHead>& heads, size_t free_slots,
                           const std::vector<StartedJob>& started,
                           std::map<std::string, double> tags = {}) {
  return pick_head(heads, free_slots, started,
                   [&](const std::string& tenant) { return tags[tenant]; });
}

QueueHead queue_head(const std::string& tenant, int64_t seq, int priority) {
  return {tenant, seq, priority, kNoDeadline, ""};
}

TEST(PickHead, the_smallest_tag_is_first_and_at_equal_tags_the_earlier_job) {
  const std::vector<QueueHead> heads = {queue_head("a", 7, 0), queue_head("b", 5, 0),
                                        queue_head("c", 9, 100)};
  EXPECT_EQ(pick(heads, 3, {}), 1u);
  EXPECT_EQ(pick(heads, 3, {}, {{"a", 1}, {"b", 2}, {"c", 0.5}}), 2u);
  EXPECT_EQ(pick({}, 3, {}), std::nullopt);
}

TEST(PickHead,
     the_last_free_slot_is_reserved_for_tenants_without_a_started_job_unless_a_job_is_urgent) {
  const std::vector<StartedJob> started = {{"a", 0}, {"a", 5}};
  EXPECT_EQ(pick({queue_head("a", 1, 0)}, 2, started), 0u);
  EXPECT_EQ(pick({queue_head("a", 1, 0)}, 1, started), std::nullopt);
  EXPECT_EQ(pick({queue_head("a", 1, 5)}, 1, started), std::nullopt);
  EXPECT_EQ(pick({queue_head("a", 1, 6)}, 1, started), 0u);
  EXPECT_EQ(pick({queue_head("a", 1, 0), queue_head("b", 2, 0)}, 1, started, {{"b", 9}}), 1u);
}

TEST(PickHead, an_earlier_deadline_is_urgent_at_equal_priority) {
  QueueHead due = queue_head("a", 1, 5);
  due.deadline_ms = 1000;
  std::vector<StartedJob> started = {{"a", 0}, {"a", 5}};
  EXPECT_EQ(pick({due}, 1, started), 0u);
  started[1].deadline_ms = 1000;
  EXPECT_EQ(pick({due}, 1, started), std::nullopt);
  started[1].deadline_ms = 1001;
  EXPECT_EQ(pick({due}, 1, started), 0u);
  started[0].priority = 6;
  EXPECT_EQ(pick({due}, 1, started), std::nullopt);
}

TEST(PickSlot, the_cache_that_has_the_input_then_the_tenants_last_then_the_first_slot) {
  const IdleSlot fresh0{1, 0, "", {}, 0}, fresh1{2, 1, "", {}, 0};
  EXPECT_EQ(pick_slot({fresh1, fresh0}, "a", "x"), 1u);
  const IdleSlot of_a{3, 2, "a", {"x"}, 4}, newer_of_a{4, 3, "a", {"y"}, 5},
      of_b{5, 4, "b", {"x"}, 9};
  EXPECT_EQ(pick_slot({fresh0, of_a, newer_of_a, of_b}, "a", "x"), 1u);
  EXPECT_EQ(pick_slot({fresh0, of_a, newer_of_a, of_b}, "a", "z"), 2u);
  EXPECT_EQ(pick_slot({fresh0, of_a, newer_of_a, of_b}, "c", "x"), 0u);
}

class SchedulerTest : public testing::ServiceTest {
 protected:
  std::string submit_as(const std::string& tenant, int priority = 0, int64_t deadline_ms = 0) {
    const Caller caller = tenant.empty() ? Caller::open() : Caller::tenant(tenant, false);
    JobRequest request;
    request.asset = service_->put_asset(caller, put_blob("mesh"), "a.ply", "").value().id;
    request.options.use_cache = false;
    if (priority != 0) request.priority = priority;
    if (deadline_ms != 0) request.deadline_ms = deadline_ms;
    auto status = service_->submit(caller, request, {});
    EXPECT_TRUE(status) << status.error().message();
    return status->id;
  }
  JobStatus get(const std::string& id) { return service_->get(Caller::daemon(), id).value(); }
};

TEST_F(SchedulerTest, within_a_tenant_priority_goes_first_then_deadline_then_arrival) {
  const std::string first = submit_as("a"), second = submit_as("a");
  const std::string due_later = submit_as("a", 0, 7'200'000), due = submit_as("a", 0, 3'600'000);
  const std::string urgent = submit_as("a", 50), never = submit_as("a", -100);
  EXPECT_EQ(get(urgent).priority, 50);
  EXPECT_GT(get(due).deadline_at_ms, unix_time_ms());
  EXPECT_EQ(get(first).deadline_at_ms, 0);
  EXPECT_EQ(get(first).waiting_for, "a worker");
  FakeWorker worker = connect();
  for (const std::string& id : {urgent, due, due_later, first, second, never}) {
    const auto task = worker.claim();
    ASSERT_TRUE(task);
    EXPECT_EQ(task->id, id);
    EXPECT_EQ(get(id).waiting_for, "");
    EXPECT_TRUE(worker.complete(*task, "r" + id));
  }
}

TEST_F(SchedulerTest, a_tenant_with_many_jobs_leaves_the_last_worker_to_others) {
  for (int i = 0; i < 5; ++i) submit_as("a");
  FakeWorker one = connect(), two = connect(), three = connect();
  std::optional<Task> tasks[3];
  std::atomic<int> claimed{0};
  std::vector<std::thread> claims;
  FakeWorker* workers[] = {&one, &two, &three};
  for (int i = 0; i < 3; ++i) {
    claims.emplace_back([&, i] {
      tasks[i] = workers[i]->claim();
      ++claimed;
    });
  }
  ASSERT_TRUE(testing::comes_true([&] { return claimed >= 2; }));
  // The second job is assigned only while the third worker waits, and its claim returns after that
  // look into the queue, which came to the third worker, too.
  EXPECT_EQ(testing::jobs_of(*service_, Caller::daemon(), 100, JobState::kRunning).size(), 2u)
      << "and not 3";
  const std::string other = submit_as("b");
  for (std::thread& claim : claims) claim.join();
  int of_b = 0;
  for (const auto& task : tasks) {
    ASSERT_TRUE(task);
    of_b += task->tenant == "b" && task->id == other ? 1 : 0;
  }
  EXPECT_EQ(of_b, 1);
}

TEST_F(SchedulerTest, a_job_whose_deadline_passes_while_it_is_queued_fails_then_and_not_later) {
  const std::string late = submit_as("", 0, 80), queued = submit_as("");
  const JobStatus status = wait_end(late);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(status.error->detail, "the job's deadline has passed");
  EXPECT_EQ(status.attempt, 0);
  EXPECT_EQ(get(queued).state, JobState::kQueued);
}

TEST_F(SchedulerTest, a_jump_of_the_systems_clock_by_three_hours_ends_no_job_with_an_hour_left) {
  constexpr int64_t kAnHourMs = 3'600'000;
  const std::string hour = submit_as("", 0, kAnHourMs), soon = submit_as("", 0, kAnHourMs / 60);
  wall_jump_ms_ = 3 * kAnHourMs;
  const std::string later = submit_as("", 0, kAnHourMs);
  // A deadline that is looked at after the jump.
  passed_ms_ = kAnHourMs / 60;
  EXPECT_EQ(wait_end(soon).error->code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(get(hour).state, JobState::kQueued);
  EXPECT_EQ(get(later).state, JobState::kQueued);
  wall_jump_ms_ = -3 * kAnHourMs;
  passed_ms_ = 2 * kAnHourMs;
  for (const std::string& id : {hour, later}) {
    EXPECT_EQ(wait_end(id).error->code, ErrorCode::kDeadlineExceeded) << "time that really passed";
  }
}

TEST_F(SchedulerTest, a_running_job_whose_deadline_passes_is_told_to_stop_and_fails_with_it) {
  FakeWorker worker = connect();
  std::string id;
  std::optional<Task> task;
  // On a busy machine the deadline may pass before the first report: the worker gets the job
  // without a deadline, or is told to stop at once, and the next job has a longer one.
  for (int64_t deadline_ms = 150; !task; deadline_ms *= 2) {
    ASSERT_LT(deadline_ms, 60'000) << "the first report of a task takes longer";
    submit_as("");
    id = submit_as("", 0, deadline_ms);
    task = worker.claim();
    ASSERT_TRUE(task);
    if (task->id == id && !worker.progress(*task, "voxelize", 1, 8).cancel) break;
    worker.complete(*task, "r");
    task.reset();
  }
  int64_t tile = 1;
  EXPECT_TRUE(testing::comes_true(
      [&] { return worker.progress(*task, "voxelize", ++tile, 1'000'000).cancel; }));
  EXPECT_TRUE(worker.fail(*task, {ErrorCode::kCancelled, "the job was cancelled", "", ""}));
  EXPECT_EQ(wait_end(id).error->code, ErrorCode::kDeadlineExceeded);
}

TEST_F(SchedulerTest, priorities_and_deadlines_out_of_range_are_refused) {
  JobRequest request;
  request.asset = put_asset("mesh");
  request.priority = 101;
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().message(),
            "priority: expected -100 to 100, got 101");
  request.priority = 0;
  request.deadline_ms = 0;
  EXPECT_EQ(service_->submit(Caller::open(), request, {}).error().code, ErrorCode::kInvalidOption);
}

TEST_F(SchedulerTest, a_job_that_a_client_waits_for_is_more_urgent_than_others) {
  JobRequest request;
  request.asset = put_asset("mesh");
  request.options.use_cache = false;
  SubmitOptions transient;
  transient.transient = true;
  EXPECT_EQ(service_->submit(Caller::open(), request, transient)->priority, 10);
  request.priority = -3;
  EXPECT_EQ(service_->submit(Caller::open(), request, transient)->priority, -3);
}

TEST_F(SchedulerTest, the_worker_that_has_the_input_gets_the_next_job_with_it) {
  FakeWorker other = connect(), knows = connect(), busy = connect();
  submit_as("a");
  const auto first = knows.claim();
  ASSERT_TRUE(first && knows.complete(*first, "r"));
  submit_as("a");
  ASSERT_TRUE(busy.claim());
  std::thread waits([&] { EXPECT_FALSE(other.claim()); });
  for (int i = 0; i < 5; ++i) {
    // The tenant has a job that runs, so the last free worker is not for it: this job is assigned
    // when both wait.
    const std::string id = submit_as("a");
    const auto next = knows.claim();
    EXPECT_TRUE(next);
    if (!next) break;
    EXPECT_EQ(next->id, id);
    EXPECT_TRUE(knows.complete(*next, "r" + id));
  }
  service_.reset();  // ends the other one's wait
  waits.join();
}

}  // namespace
}  // namespace voxeld
