// Which started jobs give up their workers.
#include "server/jobs/scheduling/preemption.h"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "server/jobs/scheduling/tenant_shares.h"

namespace voxeld {
namespace {

using Indices = std::vector<size_t>;

QueueHead head(const std::string& tenant, int64_t seq, int priority = 0,
               int64_t deadline_ms = kNoDeadline) {
  return {tenant, seq, priority, deadline_ms, "j-" + std::to_string(seq)};
}

// One that has worked for a minute after a second of preparation.
StartedJob job(const std::string& tenant, int priority = 0, int64_t seq = 0) {
  StartedJob started;
  started.tenant = tenant;
  started.priority = priority;
  started.seq = seq;
  started.is_preemptible = true;
  started.slot_seconds = 61;
  started.preparation_seconds = 1;
  return started;
}

class Preemption : public ::testing::Test {
 protected:
  PreemptionView view(const std::vector<QueueHead>& heads, const std::vector<StartedJob>& started) {
    return {heads,
            started,
            [&](const std::string& tenant) { return shares_[tenant]; },
            [&](const std::string& tenant) {
              return weights_.contains(tenant) ? weights_[tenant] : 1.0;
            },
            [&](const std::string&) { return expected_seconds_; },
            1'000'000};
  }
  Indices preempted(const std::vector<QueueHead>& heads, const std::vector<StartedJob>& started) {
    return jobs_to_preempt(view(heads, started));
  }

  std::map<std::string, double> shares_, weights_;
  double expected_seconds_ = 0;
};

TEST_F(Preemption, the_tenant_with_the_most_device_time_gives_its_worker_to_one_without) {
  shares_ = {{"a", 5}, {"b", 7}, {"c", 6}};
  const std::vector<StartedJob> started = {job("a"), job("b"), job("c")};
  EXPECT_EQ(preempted({head("d", 9)}, started), Indices{1});
  EXPECT_EQ(preempted({head("d", 9), head("e", 10)}, started), (Indices{1, 2}));
  EXPECT_EQ(preempted({}, started), Indices{});
  EXPECT_EQ(preempted({head("a", 9), head("b", 8)}, started), Indices{}) << "they have workers";
}

TEST_F(Preemption, tenants_that_are_level_do_not_pass_a_worker_to_and_fro) {
  const std::vector<StartedJob> started = {job("a")};
  shares_ = {{"a", 5}, {"b", 5}};
  EXPECT_EQ(preempted({head("b", 9)}, started), Indices{});
  shares_["a"] = 5 + kPreemptMarginSeconds / 2;
  EXPECT_EQ(preempted({head("b", 9)}, started), Indices{});
  shares_["a"] = 5 + kPreemptMarginSeconds;
  EXPECT_EQ(preempted({head("b", 9)}, started), Indices{0});
  shares_["b"] = 9;
  EXPECT_EQ(preempted({head("b", 9)}, started), Indices{}) << "who waits has had more";
  shares_ = {{"a", kPreemptMarginSeconds / 4}};
  weights_ = {{"a", 4}};
  EXPECT_EQ(preempted({head("b", 9)}, started), Indices{0}) << "the margin is of the device's time";
}

TEST_F(Preemption, a_job_works_for_longer_than_it_prepared_before_it_is_preempted) {
  StartedJob one = job("a");
  one.slot_seconds = 1 + kPreemptPreparations;
  EXPECT_TRUE(may_be_preempted(one));
  one.slot_seconds -= 0.01;
  EXPECT_FALSE(may_be_preempted(one));
  one.preparation_seconds = 0.0625;
  one.slot_seconds = 0.0625 + kPreemptQuantumSecondsMin;
  EXPECT_TRUE(may_be_preempted(one));
  one.slot_seconds -= 0.01;
  EXPECT_FALSE(may_be_preempted(one));
  one.slot_seconds = 9;
  one.device_seconds = 1e6;
  EXPECT_FALSE(may_be_preempted(one)) << "giant ones for longer";
  one.slot_seconds = 0.0625 + kPreemptQuantumSecondsMax;
  EXPECT_TRUE(may_be_preempted(one)) << "but not for ever";
  one.is_preemptible = false;
  EXPECT_FALSE(may_be_preempted(one));
}

TEST_F(Preemption, jobs_that_cannot_be_preempted_are_left_and_the_next_tenant_is_taken) {
  shares_ = {{"a", 5}, {"b", 7}};
  std::vector<StartedJob> started = {job("a"), job("b")};
  started[1].is_preemptible = false;
  EXPECT_EQ(preempted({head("c", 9)}, started), Indices{0});
  started[0].slot_seconds = 2;
  EXPECT_EQ(preempted({head("c", 9)}, started), Indices{});
}

TEST_F(Preemption, a_tenant_is_left_out_where_no_job_will_ever_stop) {
  std::vector<StartedJob> fills = {job("a"), job("b")};
  for (StartedJob& fill : fills) fill.is_preemptible = false;
  const std::vector<QueueHead> one = {head("c", 9)}, two = {head("c", 9), head("d", 10)};
  EXPECT_TRUE(is_left_out(view(one, fills)));
  EXPECT_FALSE(is_left_out(view({}, fills)));
  EXPECT_FALSE(is_left_out(view({head("a", 9)}, fills))) << "it has a worker";
  fills[1].slot_seconds = 1;
  EXPECT_FALSE(is_left_out(view(one, fills))) << "it may end soon";
  fills[1].is_preemptible = true;
  EXPECT_FALSE(is_left_out(view(one, fills)));
  EXPECT_TRUE(is_left_out(view(two, fills)));
}

TEST_F(Preemption, a_job_that_prepared_for_a_minute_will_not_stop_soon) {
  std::vector<StartedJob> started = {job("a")};
  started[0].preparation_seconds = 60;
  const std::vector<QueueHead> waiting = {head("c", 9)};
  EXPECT_TRUE(is_left_out(view(waiting, started))) << "it works for ten minutes first";
  started[0].slot_seconds = 60 + 60 * kPreemptPreparations - kPreemptedSoonSeconds - 1;
  EXPECT_TRUE(is_left_out(view(waiting, started)));
  started[0].slot_seconds += 2;
  EXPECT_FALSE(is_left_out(view(waiting, started)));
}

TEST_F(Preemption, a_tenant_that_has_several_workers_gives_one_and_loses_nothing) {
  shares_ = {{"a", 5}, {"b", 9}, {"c", 5}};
  const std::vector<StartedJob> started = {job("a", 3, 1), job("a", 0, 2), job("b")};
  EXPECT_EQ(preempted({head("c", 9)}, started), Indices{1}) << "the less urgent one";
  EXPECT_EQ(preempted({head("c", 9), head("d", 10)}, started), (Indices{1, 2}));
}

TEST_F(Preemption, a_preempted_job_stays_preempted_while_a_tenant_waits) {
  shares_ = {{"a", 5}, {"b", 7}};
  std::vector<StartedJob> started = {job("a"), job("b")};
  started[0].is_asked = true;
  EXPECT_EQ(preempted({head("c", 9)}, started), Indices{0});
  EXPECT_EQ(preempted({}, started), Indices{});
  started[0].is_preemptible = false;  // it has come to its end
  EXPECT_EQ(preempted({head("c", 9)}, started), Indices{1});
}

TEST_F(Preemption, within_a_tenant_the_more_urgent_job_has_the_worker) {
  const std::vector<StartedJob> started = {job("a", 0, 1), job("a", -2, 2), job("b", -9, 3)};
  EXPECT_EQ(preempted({head("a", 9, 1)}, started), Indices{1});
  EXPECT_EQ(preempted({head("a", 9, -1)}, started), Indices{})
      << "the other job, which is more urgent, would keep it from the last free worker";
  EXPECT_EQ(preempted({head("a", 9, -2)}, started), Indices{});
  EXPECT_EQ(preempted({head("a", 9, 1), head("c", 10)}, started), Indices{1})
      << "for c: tenants without a worker are first";
}

TEST_F(Preemption, a_deadline_in_danger_is_as_good_as_priority_against_later_ones) {
  const std::vector<StartedJob> started = {job("a")};
  expected_seconds_ = 10;
  const auto due_in = [](double due_seconds) {
    return head("a", 9, 0, 1'000'000 + static_cast<int64_t>(due_seconds * 1000));
  };
  EXPECT_EQ(preempted({due_in(24)}, started), Indices{0});
  EXPECT_EQ(preempted({due_in(26)}, started), Indices{}) << "there is time";
  std::vector<StartedJob> due = started;
  due[0].deadline_ms = 1'000'001;
  EXPECT_EQ(preempted({due_in(24)}, due), Indices{});
}

TEST(TenantShares, count_while_a_tenant_wants_the_device) {
  TenantShares shares;
  shares.set_wanting({"a"});
  shares.charge("a", 6, 2);
  EXPECT_DOUBLE_EQ(shares.of("a"), 3);
  shares.set_wanting({"a", "b"});
  EXPECT_DOUBLE_EQ(shares.of("b"), 3) << "no credit for having been away";
  shares.charge("a", 2, 1);
  shares.set_wanting({"b"});
  EXPECT_DOUBLE_EQ(shares.of("b"), 3);
  shares.set_wanting({"a", "b"});
  EXPECT_DOUBLE_EQ(shares.of("a"), 5) << "it still has had more";
  shares.charge("b", 4, 1);
  shares.set_wanting({"b"});
  shares.set_wanting({"b", "c"});
  EXPECT_DOUBLE_EQ(shares.of("c"), 7);
  EXPECT_DOUBLE_EQ(shares.of("a"), 7) << "forgotten";
}

TEST(TenantShares, the_lead_of_a_tenant_is_capped) {
  TenantShares shares;
  shares.set_wanting({"a", "b"});
  for (int i = 0; i < 100; ++i) shares.charge("a", 1, 2);
  EXPECT_DOUBLE_EQ(shares.of("a"), TenantShares::kAheadSecondsMax / 2);
  EXPECT_DOUBLE_EQ(shares.of("b"), 0);
}

}  // namespace
}  // namespace voxeld
