// Quotas of tenants: usage is exact to the byte, whatever adds or removes data. Rows count beside
// blobs, by what they take on the disk.
#include "server/jobs/records/quota.h"

#include <string>
#include <vector>

#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_connection.h"
#include "server/jobs/records/asset_store.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;

class QuotaTest : public testing::ServiceTest {
 protected:
  Result<Asset> put(const Caller& caller, const std::string& text) {
    return service_->put_asset(caller, put_blob(text), "a.ply", "");
  }
  int64_t used(const Caller& caller) { return service_->usage(caller).value().bytes; }
  // A request whose row is long: a name, an Idempotency-Key and times as an attacker has them.
  JobRequest long_request(const std::string& asset, int number) {
    JobRequest request;
    request.asset = asset;
    request.filename = std::string(240, 'n') + std::to_string(number) + ".ply";
    request.options.animation.animation = "0";
    for (int i = 0; i < 300; ++i) {
      request.options.animation.times_s.push_back((i + number) / 3e6);
    }
    return request;
  }
  static SubmitOptions long_key(int number) {
    SubmitOptions options;
    options.idempotency_key = std::string(240, 'k') + std::to_string(number);
    return options;
  }
  // A job of the caller that a worker ends with `result` as result and grid.
  // `room`: beside all that is used when the worker has it; 0: any.
  JobStatus finish(const Caller& caller, const std::string& result, int size = 64,
                   int64_t room = 0) {
    JobRequest request;
    request.asset = put(caller, "mesh").value().id;
    request.options.voxelize.placement.size = size;
    const auto submitted = service_->submit(caller, request, {});
    EXPECT_TRUE(submitted) << submitted.error().message();
    FakeWorker worker = connect();
    const auto task = worker.claim();
    if (room > 0) limits_.bytes = used(caller) + room;
    EXPECT_TRUE(task && worker.complete(*task, result));
    limits_.bytes = 0;
    return testing::wait_end(*service_, caller, submitted->id).value();
  }
  bool is_stored(const std::string& text) { return blobs().stat(sha256_id(text)).ok(); }

  const Caller lab_ = Caller::tenant("lab", false);
  const Caller studio_ = Caller::tenant("studio", false);
};

TEST_F(QuotaTest, each_blob_of_a_tenant_counts_once_and_for_each_tenant) {
  EXPECT_EQ(used(lab_), 0);
  const std::string id = put(lab_, "12345").value().id;
  const int64_t with_row = used(lab_);
  ASSERT_TRUE(put(lab_, "12345"));
  EXPECT_EQ(used(lab_), with_row);
  EXPECT_EQ(blob_bytes(lab_), 5);
  ASSERT_TRUE(put(studio_, "12345"));
  EXPECT_EQ(used(studio_), with_row);
  ASSERT_TRUE(service_->delete_asset(lab_, id));
  EXPECT_EQ(used(lab_), 0);
  EXPECT_EQ(used(studio_), with_row);
  ASSERT_TRUE(put(lab_, "12345"));  // brought back
  EXPECT_EQ(used(lab_), with_row);
}

TEST_F(QuotaTest, results_count_too) {
  finish(lab_, "0123456789");  // one file in two roles, beside "mesh"
  EXPECT_EQ(blob_bytes(lab_), 14);
  finish(lab_, "0123456789", 32);
  EXPECT_EQ(blob_bytes(lab_), 14);
  finish(lab_, "other", 16);
  EXPECT_EQ(blob_bytes(lab_), 19);
}

// The attack: jobs on one asset of 121 bytes, with long names, keys and times.
TEST_F(QuotaTest, rows_of_jobs_count_and_go_with_the_record_of_a_job) {
  const std::string asset = put(lab_, std::string(121, 'm')).value().id;
  const int64_t before = used(lab_);
  limits_.bytes = before + 100'000;
  std::vector<std::string> ids;
  Result<JobStatus> submitted = JobStatus{};
  for (int i = 0; i < 100; ++i) {
    submitted = service_->submit(lab_, long_request(asset, i), long_key(i));
    if (!submitted) break;
    ids.push_back(submitted->id);
  }
  ASSERT_FALSE(submitted);
  EXPECT_EQ(submitted.error().code, ErrorCode::kQuotaExceeded);
  // Each of them takes more than its texts.
  ASSERT_GE(ids.size(), 8U);
  EXPECT_GT((used(lab_) - before) / std::ssize(ids), 1024 + 240 + 2 * 240 + 300 * 5);
  EXPECT_EQ(used(studio_), 0);
  for (const std::string& id : ids) {
    EXPECT_EQ(service_->forget(lab_, id).error().code, ErrorCode::kConflict);
    ASSERT_TRUE(service_->cancel(lab_, id));
  }
  EXPECT_GT(used(lab_), before);
  for (const std::string& id : ids) {
    EXPECT_EQ(service_->forget(studio_, id).error().code, ErrorCode::kNotFound);
    ASSERT_TRUE(service_->forget(lab_, id));
    EXPECT_EQ(service_->forget(lab_, id).error().code, ErrorCode::kNotFound);
  }
  EXPECT_EQ(used(lab_), before);
  EXPECT_EQ(service_->usage(lab_).value().record_bytes, 0);
  // The key is free again.
  EXPECT_TRUE(service_->submit(lab_, long_request(asset, 7), long_key(0)));
}

TEST_F(QuotaTest, files_of_a_bundle_count_with_it) {
  const std::string mesh = put(lab_, "mesh").value().id;
  const int64_t before = used(lab_);
  const std::vector<BundleFile> files{{"a.ply", mesh}, {std::string(200, 'n'), mesh}};
  const std::string bundle = service_->put_bundle(lab_, put_blob("{}"), "b.json", files).value().id;
  EXPECT_GT(used(lab_) - before, 3 * 384 + 200);
  ASSERT_TRUE(service_->delete_asset(lab_, bundle));
  EXPECT_EQ(used(lab_), before);
}

TEST_F(QuotaTest, frames_of_a_running_job_count_and_what_does_not_fit_ends_it) {
  JobRequest moving;
  moving.asset = put(lab_, "mesh").value().id;
  moving.options.animation.animation = "0";
  const std::string id = service_->submit(lab_, moving, {}).value().id;
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const int64_t before = used(lab_);
  EXPECT_FALSE(worker.frame(*task, 0, "0123456789").fenced);
  const int64_t row = used(lab_) - before - 10;
  EXPECT_GT(row, 200);
  EXPECT_FALSE(worker.frame(*task, 1, "0123456789").fenced);  // the same grid
  EXPECT_EQ(used(lab_), before + 10 + 2 * row);
  limits_.bytes = used(lab_) + row + 6;
  worker.frame(*task, 2, "seven77");
  const auto status = testing::wait_end(*service_, lab_, id).value();
  ASSERT_TRUE(status.error);
  EXPECT_EQ(status.error->code, ErrorCode::kQuotaExceeded);
  EXPECT_EQ(blob_bytes(lab_), 14);
  EXPECT_FALSE(is_stored("seven77"));
}

TEST_F(QuotaTest, an_upload_that_does_not_fit_is_refused_with_the_numbers) {
  ASSERT_TRUE(put(lab_, "1234567"));
  const int64_t row = used(lab_) - 7;
  limits_.bytes = row + 10;
  EXPECT_EQ(service_->upload_room(lab_, 3).value(), 3);
  const auto more = service_->upload_room(lab_, 4);
  ASSERT_FALSE(more);
  EXPECT_EQ(more.error().code, ErrorCode::kQuotaExceeded);
  EXPECT_EQ(more.error().expected, "at most " + std::to_string(row + 10) + " bytes in all");
  EXPECT_EQ(more.error().got, "4 beside " + std::to_string(row + 7) + " used");
  EXPECT_EQ(service_->upload_room(lab_, row + 11).error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_EQ(service_->upload_room(studio_, 10).value(), row + 10);
  // A caller that skips upload_room(): the row itself is refused.
  EXPECT_EQ(put(lab_, "8901").error().code, ErrorCode::kQuotaExceeded);
  EXPECT_TRUE(put(lab_, "1234567"));  // it is there already
  EXPECT_EQ(put(lab_, "890").error().code, ErrorCode::kQuotaExceeded) << "its row does not fit";
  limits_.bytes = 2 * row + 10;
  EXPECT_EQ(put(lab_, "8901").error().code, ErrorCode::kQuotaExceeded);
  EXPECT_TRUE(put(lab_, "890"));
}

TEST_F(QuotaTest, a_result_that_does_not_fit_fails_its_job_and_is_not_kept) {
  const JobStatus status = finish(lab_, "1234567", 64, 7);
  EXPECT_EQ(status.state, JobState::kFailed);
  ASSERT_TRUE(status.error);
  EXPECT_EQ(status.error->code, ErrorCode::kQuotaExceeded);
  EXPECT_EQ(blob_bytes(lab_), 4);
  EXPECT_FALSE(is_stored("1234567"));
  EXPECT_EQ(finish(lab_, "1234567", 64, 5000).state, JobState::kDone);
}

TEST_F(QuotaTest, what_another_has_is_kept_when_a_result_like_it_is_refused) {
  finish(studio_, "1234567");
  EXPECT_EQ(finish(lab_, "1234567", 64, 7).state, JobState::kFailed);
  EXPECT_TRUE(is_stored("1234567"));
}

TEST_F(QuotaTest, so_many_jobs_of_a_tenant_may_wait) {
  limits_.queued_jobs = 2;
  JobRequest request;
  const auto submit_for = [&](const Caller& caller) {
    request.asset = put(caller, "mesh").value().id;
    return service_->submit(caller, request, {});
  };
  ASSERT_TRUE(submit_for(lab_));
  const std::string second = submit_for(lab_).value().id;
  const auto third = submit_for(lab_);
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::kTooManyRequests);
  EXPECT_EQ(third.error().expected, "fewer than 2");
  EXPECT_TRUE(submit_for(studio_));
  EXPECT_EQ(service_->usage(lab_).value().queued_jobs, 2);
  ASSERT_TRUE(service_->cancel(lab_, second));
  EXPECT_TRUE(submit_for(lab_));
}

TEST_F(QuotaTest, the_worker_is_told_how_many_cells_a_job_may_have) {
  limits_.cells = 1000;
  JobRequest request;
  request.asset = put(lab_, "mesh").value().id;
  ASSERT_TRUE(service_->submit(lab_, request, {}));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->cells_max, 1000);
}

// Code that removes rows need not know of the sums.
TEST_F(QuotaTest, rows_that_go_take_their_bytes_along) {
  finish(lab_, "0123456789");
  service_.reset();
  {
    auto writer =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
    ASSERT_TRUE(writer && writer->run("DELETE FROM results"));
    ASSERT_TRUE(writer->run("DELETE FROM assets"));
    auto left = writer->query("SELECT COUNT(*) FROM holdings");
    ASSERT_TRUE(left && left->step());
    EXPECT_EQ(left->int64(0), 0);
  }
  start();
  EXPECT_EQ(blob_bytes(lab_), 0);
  EXPECT_EQ(used(lab_), service_->usage(lab_).value().record_bytes) << "of the job alone";
}

}  // namespace
}  // namespace voxeld
