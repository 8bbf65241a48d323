// Files of the store that were changed behind its back.
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_connection.h"
#include "server/jobs/retention/store_check.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld::testing {
namespace {

class DamageTest : public ServiceTest {
 protected:
  std::filesystem::path file_of(const std::string& id) {
    return dir_.path() / "data/blobs" / id.substr(7, 2) / id;
  }
  void flip(const std::string& id) {
    std::fstream file(file_of(id), std::ios::in | std::ios::out | std::ios::binary);
    const auto byte = static_cast<char>(file.get() ^ 1);
    file.seekp(0);
    file.put(byte);
  }
  JobStatus made(const std::string& text) {
    JobRequest request;
    request.asset = put_asset("mesh");
    const JobStatus submitted = submit(request);
    if (submitted.cached) return submitted;
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(worker.complete(*task, text));
    return wait_end(submitted.id);
  }
};

TEST_F(DamageTest, a_result_is_not_served_and_is_computed_again) {
  const JobStatus job = made("result");
  ASSERT_TRUE(service_->get_result(Caller::open(), job.id));
  flip(job.result->blob);
  const auto result = service_->get_result(Caller::open(), job.id);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kGone);
  EXPECT_EQ(result.error().detail,
            "the result of the job " + job.id + " was damaged on disk; submit the job again");
  EXPECT_EQ(service_->get_grid(Caller::open(), job.result->grid).error().code, ErrorCode::kGone);
  const JobStatus again = made("result");
  EXPECT_FALSE(again.cached);
  EXPECT_EQ(again.result->blob, job.result->blob);
  // The same bytes: the first job's result is whole again, too.
  EXPECT_TRUE(service_->get_result(Caller::open(), job.id));
  EXPECT_TRUE(made("result").cached);
}

TEST_F(DamageTest, it_is_found_by_the_next_process_before_a_job_is_answered_from_it) {
  const JobStatus job = made("result");
  flip(job.result->blob);
  start();
  JobRequest request;
  request.asset = job.asset;
  EXPECT_FALSE(submit(request).cached);
}

TEST_F(DamageTest, a_file_that_was_cut_short_is_damaged) {
  const JobStatus job = made("result");
  std::filesystem::resize_file(file_of(job.result->blob), 3);
  EXPECT_EQ(service_->get_result(Caller::open(), job.id).error().code, ErrorCode::kGone);
}

TEST_F(DamageTest, an_asset_fails_its_job_and_is_repaired_by_uploading_it_again) {
  JobRequest request;
  request.asset = put_asset("mesh");
  flip(request.asset);
  const std::string broken = submit(request).id;
  FakeWorker worker = connect();
  std::thread claims([&] {
    const auto task = worker.claim();  // the next job's
    ASSERT_TRUE(task);
    EXPECT_TRUE(worker.complete(*task, "result"));
  });
  const JobStatus status = wait_end(broken);
  EXPECT_EQ(status.state, JobState::kFailed);
  EXPECT_EQ(status.error->code, ErrorCode::kGone);
  EXPECT_EQ(status.error->detail,
            "the asset " + request.asset +
                " was damaged on disk; upload the same bytes again, then submit the job again");
  put_asset("mesh");
  EXPECT_EQ(wait_end(submit(request).id).state, JobState::kDone);
  claims.join();
}

TEST_F(DamageTest, a_store_without_damage_is_checked_while_the_service_runs) {
  made("result");
  const auto report = check_store(dir_.path() / "data");
  ASSERT_TRUE(report) << report.error().message();
  EXPECT_TRUE(report->daemon_runs);
  EXPECT_EQ(report->problems.size(), 0u);
  EXPECT_EQ(report->blobs, 2);
  EXPECT_EQ(report->jobs, 1);
}

TEST_F(DamageTest, the_check_names_what_is_damaged_missing_or_left_over) {
  const JobStatus job = made("result");
  service_.reset();
  flip(job.result->blob);
  std::filesystem::remove(file_of(job.asset));
  std::ofstream(file_of(sha256_id("orphan"))) << "orphan";
  std::ofstream(dir_.path() / "data/tmp/blob-x") << "cut off";
  const auto report = check_store(dir_.path() / "data");
  ASSERT_TRUE(report) << report.error().message();
  EXPECT_FALSE(report->daemon_runs);
  ASSERT_EQ(report->problems.size(), 2u);
  EXPECT_EQ(report->problems[0].kind, "damaged");
  EXPECT_EQ(report->problems[0].what, job.result->blob);
  EXPECT_EQ(report->problems[1].kind, "missing");
  EXPECT_EQ(report->problems[1].what, job.asset);
  EXPECT_EQ(report->problems[1].text, "no file; it is named by an asset");
  EXPECT_EQ(report->orphans, std::vector<std::string>{sha256_id("orphan")});
  EXPECT_EQ(report->leftovers, std::vector<std::string>{"tmp/blob-x"});
}

TEST_F(DamageTest, the_check_counts_the_queue) {
  JobRequest request;
  request.asset = put_asset("mesh");
  submit(request);
  {
    auto database =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
    ASSERT_TRUE(database);
    ASSERT_TRUE(database->run("UPDATE live_jobs SET queued = 3 WHERE tenant = ''"));
  }
  const auto report = check_store(dir_.path() / "data");
  ASSERT_TRUE(report) << report.error().message();
  ASSERT_EQ(report->problems.size(), 1u);
  EXPECT_EQ(report->problems[0].kind, "counts");
  EXPECT_EQ(report->problems[0].what, "tenant ''");
  EXPECT_EQ(report->problems[0].text, "counts 2 queued and 0 running jobs more than there are");
}

TEST_F(DamageTest, the_check_reads_the_database_and_the_keys) {
  made("result");
  service_.reset();
  std::ofstream(dir_.path() / "data/keys") << "broken\n";
  {
    std::fstream file(dir_.path() / "data/jobs.sqlite",
                      std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4096);
    file << std::string(3 * 4096, 'x');
  }
  const auto report = check_store(dir_.path() / "data");
  ASSERT_TRUE(report) << report.error().message();
  ASSERT_EQ(report->problems.size(), 2u);
  EXPECT_EQ(report->problems[0].kind, "keys");
  EXPECT_EQ(report->problems[1].kind, "database");
  EXPECT_EQ(check_store(dir_.path() / "nowhere").error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace voxeld::testing
