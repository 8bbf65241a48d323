// The service with supervised worker processes (the helper's fake ones).
#include "server/jobs/service/job_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <prometheus/registry.h>
#include <signal.h>

#include <chrono>
#include <string>

#include "tests/folders.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/wait_job.h"

namespace voxeld {
namespace {

using Clock = JobService::Clock;
using std::chrono::milliseconds;

class JobServiceTest : public ::testing::Test {
 protected:
  void start(const std::vector<std::string>& devices = {"llvmpipe"}) {
    service_.reset();
    JobServiceConfig config;
    config.data_dir = dir_.path() / "data";
    config.devices = devices;
    config.worker_executable = test::program_dir() / "unit_jobs_helper";
    config.limits = limits_;
    auto service = start_job_service(config, std::make_shared<prometheus::Registry>());
    ASSERT_TRUE(service) << service.error().message();
    service_ = *std::move(service);
  }
  std::string submit(const std::string& filename) {
    auto writer = service_->begin_upload(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(
        writer->append({reinterpret_cast<const uint8_t*>(filename.data()), filename.size()}));
    JobRequest request;
    request.asset =
        service_->put_asset(Caller::open(), writer->finish().value(), filename, "").value().id;
    auto status = service_->submit(Caller::open(), request, {});
    EXPECT_TRUE(status) << status.error().message();
    return status->id;
  }
  JobStatus wait_end(const std::string& id) {
    return testing::wait_end(*service_, Caller::open(), id).value();
  }
  JobStatus wait_running(const std::string& id) {
    const auto deadline = Clock::now() + testing::kPatience;
    JobStatus status = service_->get(Caller::open(), id).value();
    while (status.state != JobState::kRunning && Clock::now() < deadline) {
      status = testing::wait_change(*service_, Caller::open(), id, status.version,
                                    Clock::now() + milliseconds(100))
                   .value();
    }
    return status;
  }
  int64_t worker_pid() {
    int64_t pid = 0;
    EXPECT_TRUE(testing::comes_true([&] {
      for (const WorkerState& worker : service_->workers()) {
        if (worker.connected && pid == 0) pid = worker.pid;
      }
      return pid != 0;
    }));
    return pid;
  }
  testing::TemporaryDir dir_;
  TaskLimits limits_;
  std::unique_ptr<JobService> service_;
};

TEST_F(JobServiceTest, jobs_run_on_a_supervised_worker) {
  start();
  const std::string good = submit("bunny.ply");
  const std::string bad = submit("fail.ply");
  const JobStatus done = wait_end(good);
  EXPECT_EQ(done.state, JobState::kDone);
  EXPECT_EQ(done.attempt, 1);
  const JobStatus failed = wait_end(bad);
  EXPECT_EQ(failed.state, JobState::kFailed);
  EXPECT_EQ(failed.error->message(), "fail.ply line 1: no: expected yes, got no");
}

TEST_F(JobServiceTest, a_worker_killed_in_a_job_is_restarted_and_the_job_still_ends) {
  start();
  const std::string id = submit("slow.ply");
  wait_running(id);
  const int64_t pid = worker_pid();
  ASSERT_GT(pid, 0);
  ASSERT_EQ(::kill(static_cast<pid_t>(pid), SIGKILL), 0);
  EXPECT_TRUE(
      testing::comes_true([&] { return service_->get(Caller::open(), id).value().attempt >= 2; }));
  EXPECT_EQ(wait_running(id).attempt, 2);
  EXPECT_TRUE(testing::comes_true([&] { return worker_pid() != pid; }));
  ASSERT_TRUE(service_->cancel(Caller::open(), id));
  EXPECT_EQ(wait_end(id).state, JobState::kCancelled);
  EXPECT_EQ(service_->workers()[0].restarts, 1);
}

TEST_F(JobServiceTest, a_job_that_kills_three_workers_fails_with_their_signals_and_others_go_on) {
  start();
  const std::string id = submit("crash.ply");
  const std::string after = submit("bunny.ply");
  const JobStatus status = wait_end(id);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.attempt, 3);
  ASSERT_TRUE(status.error);
  EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
  EXPECT_EQ(status.error->detail,
            "the job ended 3 workers: signal 9 (Killed), signal 9 (Killed), signal 9 (Killed)");
  EXPECT_EQ(wait_end(after).state, JobState::kDone);
}

TEST_F(JobServiceTest, a_worker_that_ignores_a_cancel_is_ended_and_the_job_is_cancelled) {
  limits_.cancel_seconds_max = 0.2;
  start();
  const std::string id = submit("deaf.ply");
  wait_running(id);
  ASSERT_TRUE(service_->cancel(Caller::open(), id));
  EXPECT_EQ(wait_end(id).state, JobState::kCancelled);
  EXPECT_EQ(wait_end(submit("bunny.ply")).state, JobState::kDone);
}

TEST_F(JobServiceTest, a_job_that_makes_no_progress_fails_after_three_workers) {
  limits_.stall_seconds_max = 0.2;
  start();
  const std::string id = submit("stuck.ply");
  const JobStatus status = wait_end(id);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
  // The seconds are those of the first report after the limit, which may be late.
  const std::string each = "no progress in stage voxelize for [0-9]+ s";
  EXPECT_THAT(status.error->detail, ::testing::MatchesRegex("the job ended 3 workers: " + each +
                                                            ", " + each + ", " + each));
}

TEST_F(JobServiceTest, a_restarted_service_finishes_jobs_that_were_running) {
  start();
  const std::string id = submit("slow.ply");
  wait_running(id);
  start();
  EXPECT_EQ(wait_running(id).attempt, 1);
  ASSERT_TRUE(service_->cancel(Caller::open(), id));
  EXPECT_EQ(wait_end(id).state, JobState::kCancelled);
}

TEST_F(JobServiceTest, a_device_that_cannot_be_opened_leaves_the_service_up_and_not_ready) {
  start({"broken"});
  submit("bunny.ply");
  EXPECT_EQ(service_->ready().error().code, ErrorCode::kDeviceUnavailable);
  EXPECT_EQ(service_->queued_jobs(), 1);
  const auto workers = service_->workers();
  ASSERT_EQ(workers.size(), 1u);
  EXPECT_EQ(workers[0].device, "broken");
  EXPECT_FALSE(workers[0].connected);
}

TEST_F(JobServiceTest, workers_of_several_devices_share_the_queue) {
  start({"llvmpipe", "osmesa"});
  const std::string slow = submit("slow.ply");
  wait_running(slow);
  EXPECT_EQ(wait_end(submit("bunny.ply")).state, JobState::kDone);
  EXPECT_EQ(service_->get(Caller::open(), slow).value().state, JobState::kRunning);
}

TEST_F(JobServiceTest, a_second_daemon_on_the_same_data_is_refused) {
  start();
  JobServiceConfig config;
  config.data_dir = dir_.path() / "data";
  const auto second = start_job_service(config, nullptr);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
  EXPECT_NE(second.error().detail.find("is in use by process"), std::string::npos);
}

}  // namespace
}  // namespace voxeld
