// The arbiter with a clock that only the holders of time slices move.
#include "server/jobs/scheduling/time_slices.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/clock.h"
#include "tests/unit/base/comes_true.h"

namespace voxeld {
namespace {

using std::chrono::milliseconds;
using Outcome = TimeSlices::Outcome;

constexpr milliseconds kQuantum{50};

class TimeSlicesTest : public ::testing::Test {
 protected:
  TimeSlicesTest() { use({}); }
  void use(TimeSlicesConfig config) {
    config.now = [this] { return TimeSlicesConfig::Clock::time_point(milliseconds(now_ms_)); };
    config.deadline_now_ms = [this] { return now_ms_.load(); };
    config.weight_of = [this](const std::string& tenant) { return weights_[tenant]; };
    config.charged = [this](const SliceTask& task, double) { order_.push_back(task.id); };
    config.cpu_seconds = [this](int64_t pid) { return cpu_seconds_[pid]; };
    config.cores = 4;
    slices_ = std::make_unique<TimeSlices>(std::move(config));
  }
  void begin(const std::string& id, const std::string& tenant, int priority = 0,
             int64_t deadline_at_ms = 0, const std::string& device = "cpu") {
    slices_->begin_task({id, 1, device, tenant, priority, deadline_at_ms, ++seq_, pid_});
  }
  Outcome take(const std::string& id, SliceNeed need = {}) {
    auto outcome = slices_->take(id, 1, need, {});
    EXPECT_TRUE(outcome) << outcome.error().message();
    return outcome ? *outcome : Outcome::kFenced;
  }
  // Asks for a time slice on a thread of its own, and returns once it is asked for.
  std::thread ask(const std::string& id, SliceNeed need = {}) {
    std::thread thread([this, id, need] {
      if (take(id, need) != Outcome::kGranted) return;
      const std::lock_guard lock(granted_mutex_);
      granted_.insert(id);
    });
    EXPECT_TRUE(testing::comes_true([&] { return slices_->is_waiting(id) || is_granted(id); }));
    return thread;
  }
  bool is_granted(const std::string& id) {
    const std::lock_guard lock(granted_mutex_);
    return granted_.contains(id);
  }
  void wait_granted(const std::string& id) {
    EXPECT_TRUE(testing::comes_true([&] { return is_granted(id); })) << id;
  }
  void wait_asked(const std::string& id) {
    EXPECT_TRUE(testing::comes_true([&] { return slices_->is_waiting(id); })) << id;
  }
  void hold(milliseconds time) { now_ms_ += time.count(); }

  std::atomic<int64_t> now_ms_{1000};
  std::map<std::string, int64_t> weights_;
  std::vector<std::string> order_;  // of time slices that ended; written under the arbiter's lock
  std::mutex granted_mutex_;
  std::set<std::string> granted_;
  int64_t seq_ = 0;
  int64_t pid_ = 0;  // of the tasks that begin
  std::map<int64_t, double> cpu_seconds_;
  std::unique_ptr<TimeSlices> slices_;
};

TEST_F(TimeSlicesTest, tenants_that_always_ask_have_shares_of_their_weights) {
  weights_ = {{"a", 1}, {"b", 2}, {"c", 4}, {"gate", 1}};
  begin("gate", "gate");
  ASSERT_EQ(take("gate"), Outcome::kGranted);  // until all three ask
  std::map<std::string, int64_t> held_ms;
  std::vector<std::thread> threads;
  std::atomic<int> rounds{700};
  for (const auto& id : {"a", "b", "c"}) {
    begin(id, id);
    // Time slices of different lengths: what counts is the time that they took.
    const milliseconds length = kQuantum + milliseconds(10 * (id[0] - 'a'));
    threads.emplace_back([this, id = std::string(id), length, &rounds] {
      for (Outcome outcome = take(id); outcome == Outcome::kGranted;) {
        hold(length);
        if (--rounds <= 0) break;
        outcome = slices_->renew(id, 1, [&rounds] { return rounds <= 0; });
      }
    });
    wait_asked(id);
  }
  slices_->give("gate", 1);
  for (std::thread& thread : threads) thread.join();
  double per_weight = 0;
  for (const auto& id : {"a", "b", "c"}) {
    held_ms[id] = slices_->device_us(id) / 1000;
    per_weight =
        std::max(per_weight, static_cast<double>(held_ms[id]) / static_cast<double>(weights_[id]));
  }
  for (const auto& [id, ms] : held_ms) {
    // Within one time slice of its own and one of the others', whose lengths are at most 70 ms.
    EXPECT_NEAR(static_cast<double>(ms) / static_cast<double>(weights_[id]), per_weight, 2 * 70.0)
        << id;
    EXPECT_GT(ms, 2000);
  }
}

TEST_F(TimeSlicesTest, a_tenant_that_was_away_gets_no_credit_for_it) {
  begin("busy", "a");
  begin("late", "b");
  begin("late too", "b");
  ASSERT_EQ(take("busy"), Outcome::kGranted);
  for (int i = 0; i < 100; ++i) {
    hold(kQuantum);
    ASSERT_EQ(slices_->renew("busy", 1, {}), Outcome::kGranted);
  }
  std::thread late = ask("late");
  hold(kQuantum);
  std::thread busy([this] { EXPECT_EQ(slices_->renew("busy", 1, {}), Outcome::kGranted); });
  late.join();  // its time slice comes at once …
  std::thread late_too = ask("late too");
  hold(2 * kQuantum);
  slices_->give("late", 1);
  EXPECT_TRUE(slices_->is_waiting("late too")) << "a credit of five seconds";
  slices_->give("late too", 1);
  busy.join();  // … and the other's after one of it, and not after five seconds
  EXPECT_EQ(order_.back(), "late");
  slices_->give("busy", 1);
  late_too.join();
}

TEST_F(TimeSlicesTest, within_a_tenant_priority_goes_first_then_deadline_then_arrival) {
  const int64_t later = unix_time_ms() + 3'600'000;
  begin("holder", "a");
  begin("first", "a");
  begin("second", "a");
  begin("due later", "a", 0, later + 1000);
  begin("due", "a", 0, later);
  begin("urgent", "a", 10);
  ASSERT_EQ(take("holder"), Outcome::kGranted);
  std::vector<std::thread> threads;
  for (const char* id : {"second", "first", "due later", "urgent", "due"}) {
    threads.push_back(ask(id));
  }
  slices_->give("holder", 1);
  for (const char* id : {"urgent", "due", "due later", "first", "second"}) {
    wait_granted(id);
    slices_->give(id, 1);
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order_,
            (std::vector<std::string>{"holder", "urgent", "due", "due later", "first", "second"}));
}

TEST_F(TimeSlicesTest, fifo_goes_by_arrival_whatever_the_priority) {
  TimeSlicesConfig config;
  config.is_fair = false;
  use(std::move(config));
  begin("one", "a");
  begin("two", "b", 50);
  begin("three", "a", 100);
  ASSERT_EQ(take("one"), Outcome::kGranted);
  std::thread three = ask("three"), two = ask("two");
  EXPECT_EQ(slices_->renew("one", 1, {}), Outcome::kGranted);
  slices_->give("one", 1);
  two.join();
  EXPECT_FALSE(is_granted("three"));
  slices_->give("two", 1);
  three.join();
}

TEST_F(TimeSlicesTest, devices_have_slices_of_their_own) {
  begin("x", "a", 0, 0, "egl:0");
  begin("y", "a", 0, 0, "egl:1");
  EXPECT_EQ(take("x"), Outcome::kGranted);
  EXPECT_EQ(take("y"), Outcome::kGranted);
}

TEST_F(TimeSlicesTest, a_stopped_task_ends_its_wait_and_delays_no_other) {
  begin("holder", "a");
  begin("cancelled", "b");
  begin("next", "c");
  ASSERT_EQ(take("holder"), Outcome::kGranted);
  std::atomic<bool> cancel{false};
  std::thread waiter([&] {
    const auto outcome = slices_->take("cancelled", 1, {}, [&] { return cancel.load(); });
    EXPECT_EQ(*outcome, Outcome::kStopped);
  });
  wait_asked("cancelled");
  std::thread next = ask("next");
  cancel = true;
  waiter.join();
  slices_->give("holder", 1);
  next.join();
  EXPECT_TRUE(is_granted("next"));
  EXPECT_EQ(slices_->renew("next", 1, [] { return true; }), Outcome::kStopped);
  EXPECT_EQ(take("holder"), Outcome::kGranted);  // what was stopped has given its time slice back
}

TEST_F(TimeSlicesTest, a_task_that_ends_fences_its_waiting_call_and_releases_its_slice) {
  begin("holder", "a");
  begin("lost", "b");
  begin("next", "c");
  ASSERT_EQ(take("holder"), Outcome::kGranted);
  std::thread lost([this] { EXPECT_EQ(*slices_->take("lost", 1, {}, {}), Outcome::kFenced); });
  wait_asked("lost");
  slices_->end_task("lost", 1);
  lost.join();
  std::thread next = ask("next");
  slices_->end_task("holder", 2);  // an older or newer attempt's end is not this one's
  EXPECT_TRUE(slices_->is_waiting("next"));
  slices_->end_task("holder", 1);  // its worker was killed
  next.join();
  EXPECT_EQ(*slices_->take("holder", 1, {}, {}), Outcome::kFenced);
  EXPECT_EQ(*slices_->take("next", 7, {}, {}), Outcome::kFenced);
}

TEST_F(TimeSlicesTest, a_task_that_begins_again_gives_back_the_slice_of_its_lost_attempt) {
  begin("lost", "a");
  begin("next", "b");
  ASSERT_EQ(take("lost"), Outcome::kGranted);
  slices_->begin_task({"lost", 2, "cpu", "a", 0, 0, ++seq_, pid_});
  bool was_asked = false;
  const auto stop_if_not_free = [&was_asked] { return std::exchange(was_asked, true); };
  EXPECT_EQ(*slices_->take("next", 1, {}, stop_if_not_free), Outcome::kGranted);
  slices_->end_task("lost", 1);  // told late: the attempt that runs has not ended
  EXPECT_EQ(*slices_->take("lost", 1, {}, {}), Outcome::kFenced);
  slices_->give("next", 1);
  EXPECT_EQ(*slices_->take("lost", 2, {}, {}), Outcome::kGranted);
}

TEST_F(TimeSlicesTest, a_deadline_that_passes_ends_the_wait) {
  begin("holder", "a");
  begin("late", "b", 0, now_ms_ + 60);
  ASSERT_EQ(take("holder"), Outcome::kGranted);
  std::thread late([this] { EXPECT_EQ(take("late"), Outcome::kStopped); });
  EXPECT_TRUE(testing::comes_true([&] { return slices_->is_waiting("late"); }));
  hold(milliseconds(60));
  late.join();
}

TEST_F(TimeSlicesTest, the_share_of_a_tenant_grows_during_its_slice) {
  weights_ = {{"a", 2}};
  EXPECT_EQ(slices_->share("cpu", "a"), 0);
  begin("x", "a");
  ASSERT_EQ(take("x"), Outcome::kGranted);
  hold(milliseconds(1000));
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 0.5);
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "b"), 0.0);
  slices_->give("x", 1);
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 0.5);
  EXPECT_EQ(slices_->device_us("x"), 1'000'000);
}

class SlicesMemory : public TimeSlicesTest {
 protected:
  static constexpr int64_t kGiga = 1'000'000'000;
  SlicesMemory() {
    TimeSlicesConfig config;
    config.host_bytes_max = 8 * kGiga;
    use(std::move(config));
  }
};

TEST_F(SlicesMemory, a_request_that_can_never_fit_is_refused_with_the_numbers) {
  begin("x", "a");
  const auto outcome = slices_->take("x", 1, {9 * kGiga, 0}, {});
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(outcome.error().message(),
            "the request needs more memory than there is for jobs: expected at most 8.0 GB, got "
            "about 9.0 GB");
  slices_->set_device_bytes("cpu", kGiga);
  EXPECT_NE(slices_->take("x", 1, {kGiga, 2 * kGiga}, {}).error().message().find("device memory"),
            std::string::npos);
  EXPECT_EQ(take("x", {8 * kGiga, kGiga}), Outcome::kGranted);  // alone it has all
}

TEST_F(SlicesMemory, a_task_that_does_not_fit_reports_its_wait_and_holds_no_slice) {
  begin("large", "a");
  begin("other", "b");
  begin("small", "c");
  ASSERT_EQ(take("large", {7 * kGiga, 0}), Outcome::kGranted);
  slices_->give("large", 1);  // its memory it keeps
  std::thread other = ask("other", {3'100'000'000, 0});
  EXPECT_EQ(slices_->waiting_for("other"), "memory: needs 3.1 GB, 1.0 of 8.0 GB free");
  EXPECT_EQ(take("small", {kGiga, 0}), Outcome::kGranted);  // both fit when the large one has gone
  EXPECT_FALSE(is_granted("other"));
  slices_->end_task("large", 1);
  EXPECT_EQ(slices_->waiting_for("other"), "a time slice on cpu: 1 tenant before");
  slices_->give("small", 1);
  other.join();
  EXPECT_EQ(slices_->waiting_for("other"), "");
}

TEST_F(SlicesMemory, a_reservation_waits_for_memory_and_lasts_until_the_first_need) {
  begin("large", "a");
  begin("again", "b");
  begin("other", "c");
  ASSERT_EQ(take("large", {6 * kGiga, 0}), Outcome::kGranted);
  slices_->give("large", 1);
  std::thread again(
      [&] { EXPECT_EQ(slices_->reserve("again", 1, 5 * kGiga, {}), Outcome::kGranted); });
  wait_asked("again");
  EXPECT_EQ(slices_->waiting_for("again"), "memory: needs 5.0 GB, 2.0 of 8.0 GB free");
  slices_->end_task("large", 1);
  again.join();
  EXPECT_EQ(slices_->granted_bytes("again"), 5 * kGiga);
  std::thread other = ask("other", {4 * kGiga, 0});
  EXPECT_FALSE(is_granted("other"));
  EXPECT_EQ(take("again", {3 * kGiga, 0}), Outcome::kGranted);  // before those that wait
  EXPECT_EQ(slices_->granted_bytes("again"), 5 * kGiga) << "the need was told too low before";
  slices_->end_task("again", 1);
  other.join();
  EXPECT_EQ(slices_->reserve("again", 1, kGiga, {}), Outcome::kFenced);
}

TEST_F(SlicesMemory, a_reservation_of_more_than_there_is_has_all_and_its_task_may_need_more) {
  begin("again", "a");
  begin("other", "b");
  EXPECT_EQ(slices_->reserve("again", 1, 20 * kGiga, {}), Outcome::kGranted);
  EXPECT_EQ(slices_->granted_bytes("again"), 8 * kGiga);
  slices_->end_task("again", 1);
  begin("again", "a");
  EXPECT_EQ(slices_->reserve("again", 1, 2 * kGiga, {}), Outcome::kGranted);
  ASSERT_EQ(take("other", {4 * kGiga, 0}), Outcome::kGranted);
  slices_->give("other", 1);
  std::thread again = ask("again", {5 * kGiga, 0});
  EXPECT_FALSE(is_granted("again"));
  slices_->end_task("other", 1);
  again.join();
}

TEST_F(SlicesMemory, no_task_overtakes_one_that_it_would_then_block_on) {
  begin("large", "a");
  begin("other", "b");
  begin("small", "c");
  ASSERT_EQ(take("large", {6 * kGiga, 0}), Outcome::kGranted);
  slices_->give("large", 1);
  std::thread other = ask("other", {7 * kGiga, 0});
  std::thread small = ask("small", {2 * kGiga, 0});  // it would fit, but not beside the other one
  EXPECT_FALSE(is_granted("small"));
  slices_->end_task("large", 1);
  other.join();
  EXPECT_FALSE(is_granted("small"));
  slices_->end_task("other", 1);
  small.join();
}

TEST_F(SlicesMemory, tasks_that_each_need_all_have_it_one_after_the_other_on_any_device) {
  std::vector<std::thread> threads;
  std::atomic<int> done{0};
  for (int i = 0; i < 8; ++i) {
    const std::string id = "t" + std::to_string(i);
    begin(id, i % 2 == 0 ? "a" : "b", i % 3, 0, i % 4 < 2 ? "egl:0" : "egl:1");
    threads.emplace_back([this, id, &done] {
      EXPECT_EQ(take(id, {8 * kGiga, 0}), Outcome::kGranted);
      slices_->end_task(id, 1);
      ++done;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(done, 8);
}

// Four seconds of one core are one second of a machine with four.
TEST_F(TimeSlicesTest, cpu_time_outside_slices_counts_as_a_core_s_share_of_the_device) {
  pid_ = 7;
  begin("a1", "a");
  pid_ = 8;
  begin("b1", "b");
  slices_->set_queued("cpu", {"a", "b"});
  cpu_seconds_[7] = 4;
  slices_->charge_cpu();
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 1.0);
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "b"), 0.0);
  cpu_seconds_[7] = 6;
  slices_->end_task("a1", 1);  // what came since is charged with the end
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 1.5);
}

TEST_F(TimeSlicesTest, cpu_time_within_a_slice_is_not_charged_twice) {
  pid_ = 7;
  begin("a1", "a");
  slices_->set_queued("cpu", {"a"});
  EXPECT_EQ(take("a1"), Outcome::kGranted);
  cpu_seconds_[7] = 4;
  slices_->charge_cpu();
  cpu_seconds_[7] = 8;
  hold(kQuantum);
  slices_->give("a1", 1);
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 0.05);
  cpu_seconds_[7] = 8.4;
  slices_->charge_cpu();
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 0.15);
}

TEST_F(TimeSlicesTest, a_lost_worker_counts_as_time_of_the_device) {
  weights_ = {{"a", 2}, {"b", 1}};
  begin("b1", "b");
  slices_->set_queued("cpu", {"a", "b"});
  slices_->charge_lost_worker("cpu", "a");
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), TimeSlices::kLostWorkerSeconds / 2);
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "b"), 0);
}

TEST_F(TimeSlicesTest, a_tenant_that_has_parsed_comes_after_one_that_has_not) {
  pid_ = 7;
  begin("a1", "a");
  pid_ = 0;
  begin("b1", "b");
  begin("c1", "c");
  EXPECT_EQ(take("c1"), Outcome::kGranted);
  cpu_seconds_[7] = 4;
  std::thread a = ask("a1"), b = ask("b1");
  slices_->charge_cpu();
  slices_->give("c1", 1);
  wait_granted("b1");
  EXPECT_FALSE(is_granted("a1"));
  slices_->give("b1", 1);
  a.join();
  b.join();
}

TEST_F(TimeSlicesTest, a_revoked_slice_is_charged_and_the_next_one_is_granted) {
  begin("a1", "a");
  begin("b1", "b");
  slices_->set_queued("cpu", {"a", "b"});
  EXPECT_EQ(take("a1"), Outcome::kGranted);
  std::thread b = ask("b1");
  hold(milliseconds(2000));
  EXPECT_TRUE(slices_->take_away("a1"));
  b.join();
  EXPECT_DOUBLE_EQ(slices_->share("cpu", "a"), 2.0);
  EXPECT_FALSE(slices_->take_away("a1"));  // it has none
  EXPECT_FALSE(slices_->take_away("nobody"));
  slices_->give("a1", 1);  // of no effect on the one that has it now
  EXPECT_TRUE(slices_->take_away("b1"));
  EXPECT_EQ(slices_->renew("a1", 1, {}), Outcome::kGranted);  // it has come back
}

// Mostly the thread that waits has not seen it yet.
TEST_F(TimeSlicesTest, a_slice_that_is_taken_away_at_once_is_granted_again) {
  begin("a1", "a");
  begin("b1", "b");
  for (int round = 0; round < 100; ++round) {
    EXPECT_EQ(take("a1"), Outcome::kGranted);
    Outcome outcome{};
    const Stopwatch age;
    std::thread b(
        [&] { outcome = *slices_->take("b1", 1, {}, [&] { return age.ms() > 60'000; }); });
    wait_asked("b1");
    slices_->give("a1", 1);
    slices_->take_away("b1");
    b.join();
    ASSERT_EQ(outcome, Outcome::kGranted);
    slices_->give("b1", 1);
  }
}

}  // namespace
}  // namespace voxeld
