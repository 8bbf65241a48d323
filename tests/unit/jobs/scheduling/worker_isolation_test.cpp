// Which tenants' tasks a worker process gets after others, and by what it is replaced.
#include "server/jobs/scheduling/worker_isolation.h"

#include <gtest/gtest.h>
#include <prometheus/registry.h>

#include <chrono>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/jobs/scheduling/slots.h"
#include "tests/folders.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;
using enum WorkerIsolation;

IdleSlot idle(int64_t connection, const std::vector<std::string>& tenants = {}) {
  IdleSlot slot;
  slot.connection = connection;
  slot.ended_at = tenants.empty() ? 0 : connection;
  for (const std::string& tenant : tenants) slot.past.add(tenant, tenant);
  return slot;
}

QueueHead head_of(const std::string& tenant, int64_t seq) {
  return {tenant, seq, 0, kNoDeadline, "", tenant};
}

TEST(WorkerPast, a_tenants_files_keep_the_process_from_others_and_a_mixed_past_from_all) {
  WorkerPast past;
  const auto may_run = [&](WorkerIsolation isolation, const char* tenant) {
    return past.may_run(isolation, tenant, tenant);
  };
  for (const WorkerIsolation isolation : {kNone, kTenant, kTask}) {
    EXPECT_TRUE(may_run(isolation, "a"));
    EXPECT_FALSE(past.is_used_up(isolation));
  }
  past.add("", "");  // jobs of a daemon without keys are a tenant's, too
  EXPECT_FALSE(past.is_fresh());
  EXPECT_TRUE(may_run(kTenant, ""));
  EXPECT_FALSE(may_run(kTenant, "a"));
  EXPECT_FALSE(may_run(kTask, ""));
  EXPECT_FALSE(past.is_used_up(kTenant));
  EXPECT_TRUE(past.is_used_up(kTask));
  past.add("a", "a");
  EXPECT_TRUE(may_run(kNone, "b"));
  for (const char* tenant : {"", "a", "b"}) EXPECT_FALSE(may_run(kTenant, tenant));
  EXPECT_TRUE(past.is_used_up(kTenant));
}

TEST(WorkerPast, an_admins_task_on_anothers_file_takes_a_fresh_process_and_is_its_last) {
  WorkerPast past;
  past.add("boss", "boss");
  EXPECT_FALSE(past.may_run(kTenant, "boss", "a"));
  EXPECT_TRUE(past.may_run(kNone, "boss", "a"));
  WorkerPast fresh;
  EXPECT_TRUE(fresh.may_run(kTenant, "boss", "a"));
  fresh.add("boss", "a");
  EXPECT_TRUE(fresh.is_used_up(kTenant));
  EXPECT_FALSE(fresh.may_run(kTenant, "boss", "boss"));
  EXPECT_FALSE(fresh.may_run(kTenant, "a", "a"));
}

TEST(PickRunnableHead,
     a_tenant_without_a_worker_stays_first_and_others_take_the_remaining_workers) {
  const std::vector<QueueHead> heads = {head_of("a", 1), head_of("b", 2)};
  const std::vector<IdleSlot> slots = {idle(1, {"b"}), idle(2, {"c"})};
  const auto pick = [&](size_t free, std::map<std::string, double> shares) {
    return pick_runnable_head(heads, slots, free, {}, kTenant,
                              [&](const std::string& tenant) { return shares[tenant]; });
  };
  // `a` is first, and has no worker: of one place it keeps that, of two b has the other.
  EXPECT_EQ(pick(1, {}).head, std::nullopt);
  EXPECT_EQ(pick(1, {}).blocked, 1);
  EXPECT_EQ(pick(2, {}).head, 1u);
  EXPECT_EQ(pick(2, {}).blocked, 1);
  // b is first, and has one.
  EXPECT_EQ(pick(1, {{"a", 1}}).head, 1u);
  EXPECT_EQ(pick(1, {{"a", 1}}).blocked, 0);
}

TEST(WorkersToReplace, used_up_workers_at_once_and_then_the_longest_idle_one) {
  const std::vector<IdleSlot> slots = {idle(5, {"a"}), idle(3, {"b"}), idle(9),
                                       idle(4, {"a", "b"})};
  using Connections = std::vector<int64_t>;
  EXPECT_EQ(workers_to_replace(slots, kNone, 0, 0), Connections());
  EXPECT_EQ(workers_to_replace(slots, kTenant, 1, 0), Connections({4}));
  EXPECT_EQ(workers_to_replace(slots, kTenant, 3, 0), Connections({4, 3}));
  EXPECT_EQ(workers_to_replace(slots, kTenant, 3, 1), Connections({4}));
  EXPECT_EQ(workers_to_replace(slots, kTenant, 9, 0), Connections({4, 3, 5}));
  EXPECT_EQ(workers_to_replace(slots, kTask, 0, 0), Connections({3, 4, 5}));
}

// Workers that the test plays, without a supervisor: a replaced one is disconnected.
class IsolatedService : public testing::ServiceTest {
 protected:
  std::string submit_for(const std::string& tenant, const std::string& text) {
    const Caller caller = Caller::tenant(tenant, false);
    JobRequest request;
    request.asset = service_->put_asset(caller, put_blob(text), "a.ply", "").value().id;
    return service_->submit(caller, request, {}).value().id;
  }
  // Whether the worker's next task is the job.
  static bool runs(FakeWorker& worker, const std::string& job) {
    const auto task = worker.claim();
    return task && task->id == job && worker.complete(*task, "result of " + job);
  }
};

TEST_F(IsolatedService, a_worker_that_read_a_tenants_file_gets_no_other_tenants) {
  isolation_ = kTenant;
  FakeWorker worker = connect();
  EXPECT_TRUE(runs(worker, submit_for("a", "1")));
  EXPECT_TRUE(runs(worker, submit_for("a", "2")));
  const std::string job = submit_for("b", "3");
  EXPECT_FALSE(worker.claim()) << "it is disconnected";
  FakeWorker fresh = connect();
  const auto task = fresh.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, job);
  EXPECT_EQ(task->attempt, 1) << "no attempt is lost";
  EXPECT_TRUE(fresh.complete(*task, "result"));
}

TEST_F(IsolatedService, also_after_a_task_that_failed) {
  isolation_ = kTenant;
  FakeWorker worker = connect();
  submit_for("a", "1");
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.fail(*task, {ErrorCode::kMalformedMesh, "no", "", ""}));
  submit_for("b", "2");
  EXPECT_FALSE(worker.claim());
}

TEST_F(IsolatedService, an_admins_request_for_a_tenants_grid_takes_a_fresh_worker) {
  FakeWorker first = connect();
  const std::string made = submit_for("a", "1");
  EXPECT_TRUE(runs(first, made));
  const auto status = service_->get(Caller::tenant("a", false), made);
  ASSERT_TRUE(status && status->result);
  isolation_ = kTenant;
  FakeWorker of_boss = connect();
  const Caller boss = Caller::tenant("boss", true);
  JobRequest look;
  look.kind = JobKind::kRender;
  look.grid = status->result->grid;
  const auto job = service_->submit(boss, look, {});
  ASSERT_TRUE(job) << job.error().message();
  const auto task = of_boss.claim();
  ASSERT_TRUE(task && task->id == job->id);
  EXPECT_TRUE(of_boss.complete(*task, "image"));
  submit_for("boss", "2");
  EXPECT_FALSE(of_boss.claim());
}

TEST_F(IsolatedService, by_task_each_worker_gets_one) {
  isolation_ = kTask;
  FakeWorker first = connect();
  EXPECT_TRUE(runs(first, submit_for("a", "1")));
  EXPECT_FALSE(first.claim());
  FakeWorker second = connect();
  EXPECT_TRUE(runs(second, submit_for("a", "2")));
}

TEST_F(IsolatedService, isolation_that_begins_later_counts_earlier_tasks) {
  FakeWorker worker = connect();
  EXPECT_TRUE(runs(worker, submit_for("a", "1")));
  EXPECT_TRUE(runs(worker, submit_for("b", "2")));
  isolation_ = kTenant;
  const std::string job = submit_for("b", "3");
  EXPECT_FALSE(worker.claim()) << "a may have it since";
  FakeWorker fresh = connect();
  EXPECT_TRUE(runs(fresh, job));
}

TEST_F(IsolatedService, a_tenant_with_a_worker_is_served_while_another_waits_for_one) {
  isolation_ = kTenant;
  FakeWorker of_a = connect(), of_b = connect();
  const std::string first = submit_for("a", "1");
  const auto task = of_a.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->id, first);
  EXPECT_TRUE(runs(of_b, submit_for("b", "2")));
  const std::string next = submit_for("b", "3");
  EXPECT_TRUE(runs(of_b, next));
  EXPECT_TRUE(of_a.complete(*task, "result"));
}

// Processes of a supervisor.
class IsolatedProcesses : public ::testing::Test {
 protected:
  void start(WorkerIsolation isolation, int workers) {
    JobServiceConfig config;
    config.data_dir = dir_.path() / "data";
    config.devices = {"llvmpipe"};
    config.worker_executable = test::program_dir() / "unit_jobs_helper";
    config.workers_per_device = workers;
    config.isolation = [isolation] { return isolation; };
    service_ = start_job_service(config, registry_).value();
  }
  // The number of the process that ran a job of the tenant.
  std::string pid_of_job(const std::string& tenant) {
    const Caller caller = Caller::tenant(tenant, false);
    auto writer = service_->begin_upload(100);
    const std::string text = tenant + std::to_string(++jobs_);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    JobRequest request;
    request.asset = service_->put_asset(caller, writer->finish().value(), "pid.ply", "").value().id;
    const std::string job = service_->submit(caller, request, {}).value().id;
    const JobStatus ended = testing::wait_end(*service_, caller, job).value();
    EXPECT_EQ(ended.state, JobState::kDone);
    EXPECT_EQ(ended.attempt, 1);
    if (!ended.result) return "";
    std::ifstream file(BlobStore::open(dir_.path() / "data").value().path_of(ended.result->blob));
    std::string pid;
    file >> pid;
    return pid;
  }
  // The sum over all devices; -1 if there is no such counter.
  double counter(std::string_view name) const {
    for (const prometheus::MetricFamily& family : registry_->Collect()) {
      if (family.name != name) continue;
      double sum = 0;
      for (const prometheus::ClientMetric& metric : family.metric) sum += metric.counter.value;
      return sum;
    }
    return -1;
  }

  testing::TemporaryDir dir_;
  std::shared_ptr<prometheus::Registry> registry_ = std::make_shared<prometheus::Registry>();
  std::unique_ptr<JobService> service_;
  int jobs_ = 0;
};

TEST_F(IsolatedProcesses, no_process_works_for_two_tenants_and_none_counts_as_a_crash) {
  start(kTenant, 2);
  std::map<std::string, std::set<std::string>> tenants_of;
  for (int round = 0; round < 3; ++round) {
    for (const char* tenant : {"a", "b", "c", "d", "e"}) {
      tenants_of[pid_of_job(tenant)].insert(tenant);
      tenants_of[pid_of_job(tenant)].insert(tenant);
    }
  }
  for (const auto& [pid, tenants] : tenants_of) EXPECT_EQ(tenants.size(), 1u) << pid;
  EXPECT_GT(counter("voxeld_worker_replacements_total"), 0);
  EXPECT_EQ(counter("voxeld_worker_restarts_total"), 0);
}

// A job that comes before the tenant's worker asks for its next task may take the worker in
// reserve, and one that comes before all workers have connected may have one replaced. So the first
// rounds may move, and the later ones must not.
TEST_F(IsolatedProcesses, as_many_tenants_as_workers_come_to_have_one_each) {
  constexpr int kRoundsMax = 60, kStableRounds = 5;
  start(kTenant, 2);
  std::string of_a, of_b;
  int stable = 0;
  for (int round = 0; round < kRoundsMax && stable < kStableRounds; ++round) {
    const std::string last_of_a = std::exchange(of_a, pid_of_job("a"));
    const std::string last_of_b = std::exchange(of_b, pid_of_job("b"));
    stable = of_a == last_of_a && of_b == last_of_b ? stable + 1 : 0;
    EXPECT_NE(of_a, of_b);
  }
  EXPECT_EQ(stable, kStableRounds);
}

TEST_F(IsolatedProcesses, by_task_each_has_its_own) {
  start(kTask, 2);
  std::set<std::string> pids;
  for (int i = 0; i < 6; ++i) pids.insert(pid_of_job("a"));
  EXPECT_EQ(pids.size(), 6u);
}

TEST_F(IsolatedProcesses, without_isolation_no_process_is_replaced) {
  start(kNone, 2);
  std::set<std::string> pids;
  for (const char* tenant : {"a", "b", "c", "a", "b", "c"}) pids.insert(pid_of_job(tenant));
  EXPECT_LE(pids.size(), 2u);
  EXPECT_EQ(counter("voxeld_worker_replacements_total"), 0);
}

}  // namespace
}  // namespace voxeld
