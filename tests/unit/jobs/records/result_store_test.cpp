// Deletion of stored results: usage goes down at once; other tenants and live jobs keep theirs.
#include "server/jobs/records/result_store.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_connection.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;

class ResultStoreTest : public testing::ServiceTest {
 protected:
  std::string put(const Caller& caller, const std::string& text = "mesh") {
    return service_->put_asset(caller, put_blob(text), "a.ply", "").value().id;
  }
  int64_t used(const Caller& caller) { return blob_bytes(caller); }
  JobStatus ended(const Caller& caller, const std::string& id) {
    return testing::wait_end(*service_, caller, id).value();
  }
  // A job of the caller that a worker ended with `text` as result and grid.
  JobStatus finish(const Caller& caller, const std::string& text, int size = 64) {
    JobRequest request;
    request.asset = put(caller);
    request.options.voxelize.placement.size = size;
    const std::string id = service_->submit(caller, request, {}).value().id;
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(task && worker.complete(*task, text));
    return ended(caller, id);
  }
  std::string submit_moving(const Caller& caller) {
    JobRequest moving;
    moving.asset = put(caller);
    moving.options.animation.animation = "0";
    return service_->submit(caller, moving, {}).value().id;
  }
  JobStatus finish_sequence(const Caller& caller) {
    const std::string id = submit_moving(caller);
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(task);
    worker.frame(*task, 0, "first");
    worker.frame(*task, 1, "second");
    worker.complete_sequence(*task, {"first", "second"}, "all");
    return ended(caller, id);
  }
  JobStatus render(const Caller& caller, const std::string& grid, const std::string& sequence) {
    JobRequest request;
    request.kind = JobKind::kRender;
    request.grid = grid;
    request.sequence = sequence;
    return service_->submit(caller, request, {}).value();
  }
  bool is_stored(const std::string& text) { return blobs().stat(sha256_id(text)).ok(); }
  // Files go with the sweep, a second later.
  bool goes(const std::string& text) {
    return testing::comes_true([&] { return !is_stored(text); });
  }
  // Returns when the sweep has looked at all that was deleted so far: a result that is deleted last
  // is gone. make_last() before that, while no job is queued.
  void make_last() { last_ = finish(last_tenant_, kLast).id; }
  void sweep() {
    ASSERT_TRUE(service_->delete_result(last_tenant_, last_));
    EXPECT_TRUE(goes(kLast));
  }
  void expect_deleted(const Result<StoredBlob>& blob, const std::string& message) {
    ASSERT_FALSE(blob);
    EXPECT_EQ(blob.error().code, ErrorCode::kGone);
    EXPECT_EQ(blob.error().message(), message);
  }

  const Caller lab_ = Caller::tenant("lab", false);
  const Caller studio_ = Caller::tenant("studio", false);
  const Caller boss_ = Caller::tenant("boss", true);

 private:
  static constexpr const char* kLast = "the last one to be deleted";
  const Caller last_tenant_ = Caller::tenant("last", false);
  std::string last_;
};

TEST_F(ResultStoreTest, a_deleted_result_counts_no_more_and_says_that_it_was_deleted) {
  const JobStatus job = finish(lab_, "0123456789");
  const std::string grid = job.result->grid;
  EXPECT_EQ(used(lab_), 14);
  ASSERT_TRUE(service_->delete_result(lab_, job.id));
  EXPECT_EQ(used(lab_), 4);
  expect_deleted(service_->get_result(lab_, job.id),
                 "the result of the job " + job.id + " was deleted; submit the job again");
  expect_deleted(service_->get_grid(lab_, grid),
                 "the grid " + grid + " was deleted; submit the job that made it again");
  EXPECT_EQ(service_->delete_result(lab_, job.id).error().code, ErrorCode::kGone);
  EXPECT_EQ(service_->delete_grid(lab_, grid).error().code, ErrorCode::kGone);
  EXPECT_TRUE(service_->list_kept(lab_, KeptKind::kResult, 10, 0)->empty());
  EXPECT_TRUE(goes("0123456789"));
  EXPECT_TRUE(is_stored("mesh"));
  // Equal work is made anew.
  EXPECT_FALSE(finish(lab_, "0123456789").cached);
  EXPECT_EQ(used(lab_), 14);
}

TEST_F(ResultStoreTest, grids_and_sequences_are_deleted_by_their_ids) {
  const std::string grid = finish(lab_, "0123456789").result->grid;
  ASSERT_TRUE(service_->delete_grid(lab_, grid));
  EXPECT_EQ(used(lab_), 4);
  const JobStatus moving = finish_sequence(lab_);
  const std::string sequence = moving.result->sequence;
  EXPECT_GT(used(lab_), 4 + 5 + 6 + 3);
  // A frame goes with the others alone.
  const Status frame = service_->delete_grid(lab_, sha256_id("first"));
  EXPECT_EQ(frame.error().code, ErrorCode::kConflict);
  EXPECT_EQ(frame.error().message(),
            "the grid " + sha256_id("first") + " is a frame of the job " + moving.id +
                "; delete the result of that job: expected a grid that is a result, got a frame");
  ASSERT_TRUE(service_->delete_sequence(lab_, sequence));
  EXPECT_EQ(used(lab_), 4);
  EXPECT_EQ(service_->get_sequence(lab_, sequence).error().message(),
            "the sequence " + sequence + " was deleted; submit the job that made it again");
  expect_deleted(
      service_->get_grid(lab_, sha256_id("first")),
      "the grid " + sha256_id("first") + " was deleted; submit the job that made it again");
  for (const char* text : {"first", "second", "all"}) EXPECT_TRUE(goes(text)) << text;
}

TEST_F(ResultStoreTest, what_another_tenant_has_stays_and_is_not_told_of) {
  make_last();
  const JobStatus ours = finish(lab_, "0123456789");
  const JobStatus theirs = finish(studio_, "0123456789");
  for (const Status& hidden :
       {service_->delete_result(studio_, ours.id), service_->delete_result(studio_, "j-0")}) {
    EXPECT_EQ(hidden.error().code, ErrorCode::kNotFound);
    EXPECT_EQ(hidden.error().detail, "no such job");
  }
  ASSERT_TRUE(service_->delete_result(lab_, ours.id));
  EXPECT_EQ(used(lab_), 4);
  EXPECT_EQ(used(studio_), 14);
  // The bytes are there, but no longer lab's.
  EXPECT_FALSE(service_->get_result(lab_, ours.id));
  EXPECT_FALSE(service_->get_grid(lab_, ours.result->grid));
  JobRequest again;
  again.kind = JobKind::kRender;
  again.grid = ours.result->grid;
  EXPECT_EQ(service_->submit(lab_, again, {}).error().code, ErrorCode::kGone);
  EXPECT_TRUE(service_->get_result(studio_, theirs.id));
  sweep();
  EXPECT_TRUE(service_->get_grid(studio_, theirs.result->grid));
  // An admin's deletion is of every tenant's.
  finish(lab_, "0123456789");
  ASSERT_TRUE(service_->delete_grid(boss_, theirs.result->grid));
  EXPECT_EQ(used(lab_) + used(studio_), 8);
  EXPECT_TRUE(goes("0123456789"));
}

TEST_F(ResultStoreTest, equal_jobs_share_a_result_and_lose_it_together) {
  const JobStatus first = finish(lab_, "0123456789");
  JobRequest equal;
  equal.asset = put(lab_);
  equal.options.voxelize.placement.size = 64;
  const JobStatus second = service_->submit(lab_, equal, {}).value();
  EXPECT_TRUE(second.cached);
  ASSERT_TRUE(service_->delete_result(lab_, second.id));
  EXPECT_FALSE(service_->get_result(lab_, first.id));
  EXPECT_EQ(service_->delete_result(lab_, first.id).error().code, ErrorCode::kGone);
}

TEST_F(ResultStoreTest, a_live_job_keeps_the_grid_that_it_works_on) {
  make_last();
  const std::string grid = finish(lab_, "0123456789").result->grid;
  const JobStatus waits = render(lab_, grid, "");
  ASSERT_TRUE(service_->delete_grid(lab_, grid));
  EXPECT_EQ(used(lab_), 4);
  sweep();
  EXPECT_TRUE(is_stored("0123456789"));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "an image"));
  EXPECT_EQ(ended(lab_, waits.id).state, JobState::kDone);
  EXPECT_TRUE(goes("0123456789"));
}

TEST_F(ResultStoreTest, a_live_job_keeps_the_frames_of_its_sequence) {
  make_last();
  const std::string sequence = finish_sequence(lab_).result->sequence;
  const JobStatus waits = render(lab_, "", sequence);
  ASSERT_TRUE(service_->delete_sequence(lab_, sequence));
  EXPECT_EQ(used(lab_), 4);
  sweep();
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->frame_paths.size(), 2U);
  ASSERT_TRUE(worker.complete(*task, "an image"));
  EXPECT_EQ(ended(lab_, waits.id).state, JobState::kDone);
  for (const char* text : {"first", "second"}) EXPECT_TRUE(goes(text)) << text;
}

TEST_F(ResultStoreTest, of_a_sequence_that_was_deleted_under_a_job_nothing_stays) {
  put(lab_);
  const int64_t before = service_->usage(lab_)->bytes;
  for (const bool is_record_first : {false, true}) {
    const JobStatus moving = finish_sequence(lab_);
    const JobStatus waits = render(lab_, "", moving.result->sequence);
    const auto forget = [&] { ASSERT_TRUE(service_->forget(lab_, moving.id)); };
    if (is_record_first) forget();
    ASSERT_TRUE(service_->delete_sequence(lab_, moving.result->sequence));
    if (!is_record_first) forget();
    FakeWorker worker = connect();
    const auto task = worker.claim();
    ASSERT_TRUE(task && worker.complete(*task, "an image"));
    EXPECT_EQ(ended(lab_, waits.id).state, JobState::kDone);
    for (const char* text : {"first", "second"}) EXPECT_TRUE(goes(text)) << text;
    ASSERT_TRUE(service_->delete_result(lab_, waits.id));
    ASSERT_TRUE(service_->forget(lab_, waits.id));
    EXPECT_EQ(service_->usage(lab_)->bytes, before) << "rows count, too";
  }
}

TEST_F(ResultStoreTest, a_job_that_lives_has_nothing_to_delete_and_one_that_failed_its_frames) {
  const std::string id = submit_moving(lab_);
  const Status refused = service_->delete_result(lab_, id);
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
  EXPECT_EQ(refused.error().message(),
            "the job " + id +
                " has not ended; cancel it first: expected done, failed or "
                "cancelled, got queued");
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  worker.frame(*task, 0, "first");
  worker.fail(*task, {ErrorCode::kMalformedMesh, "no", "", ""});
  EXPECT_EQ(ended(lab_, id).state, JobState::kFailed);
  EXPECT_EQ(used(lab_), 4 + 5);
  ASSERT_TRUE(service_->delete_result(lab_, id));
  EXPECT_EQ(used(lab_), 4);
  EXPECT_TRUE(goes("first"));
}

TEST_F(ResultStoreTest, lists_go_by_pages_and_name_each_grid_once) {
  std::vector<std::string> jobs;
  for (int i = 0; i < 5; ++i) {
    jobs.push_back(finish(lab_, "grid " + std::to_string(i % 4), 16 + i).id);
  }
  finish(studio_, "grid 0");
  std::vector<std::string> seen;
  int64_t before = 0;
  while (true) {
    const auto page = service_->list_kept(lab_, KeptKind::kResult, 2, before).value();
    if (page.empty()) break;
    for (const KeptResult& one : page) {
      seen.push_back(one.job);
      EXPECT_EQ(one.bytes, 6);
    }
    before = page.back().seq;
  }
  std::ranges::reverse(seen);
  EXPECT_EQ(seen, jobs);
  const auto grids = service_->list_kept(lab_, KeptKind::kGrid, 10, 0).value();
  ASSERT_EQ(grids.size(), 4U);
  EXPECT_EQ(grids[0].job, jobs[4]) << "the newest of two results with the same grid";
  EXPECT_EQ(service_->list_kept(studio_, KeptKind::kGrid, 10, 0)->size(), 1U);
  EXPECT_EQ(service_->list_kept(boss_, KeptKind::kGrid, 10, 0)->size(), 5U);
  EXPECT_TRUE(service_->list_kept(lab_, KeptKind::kSequence, 10, 0)->empty());
  const JobStatus moving = finish_sequence(lab_);
  const auto sequences = service_->list_kept(lab_, KeptKind::kSequence, 10, 0).value();
  ASSERT_EQ(sequences.size(), 1U);
  EXPECT_EQ(sequences[0].sequence, moving.result->sequence);
  EXPECT_EQ(sequences[0].frames, 2);
}

TEST_F(ResultStoreTest, the_result_of_a_job_that_was_forgotten_is_deleted_by_its_id) {
  const JobStatus job = finish(lab_, "0123456789");
  service_.reset();
  {
    auto writer =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kWriter);
    ASSERT_TRUE(writer && writer->run("DELETE FROM jobs"));
  }
  start();
  const auto kept = service_->list_kept(lab_, KeptKind::kResult, 10, 0).value();
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_EQ(kept[0].job, job.id);
  EXPECT_EQ(service_->delete_result(studio_, job.id).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(service_->delete_result(lab_, job.id));
  EXPECT_EQ(used(lab_), 4);
  EXPECT_EQ(service_->delete_result(lab_, job.id).error().code, ErrorCode::kNotFound);
}

TEST_F(ResultStoreTest, a_tenant_at_its_quota_can_go_on_after_a_deletion) {
  const JobStatus job = finish(lab_, "0123456789");
  const int64_t used = service_->usage(lab_).value().bytes;
  limits_.bytes = used;
  EXPECT_EQ(service_->put_asset(lab_, put_blob("another mesh"), "", "").error().code,
            ErrorCode::kQuotaExceeded);
  // Bytes that the tenant has already cost nothing; they are admitted by their length.
  EXPECT_EQ(service_->upload_room(lab_, 4).value(), 4);
  EXPECT_TRUE(service_->put_asset(lab_, put_blob("mesh"), "", ""));
  EXPECT_EQ(service_->upload_room(lab_, 5).error().code, ErrorCode::kQuotaExceeded);
  EXPECT_EQ(service_->upload_room(lab_, 0).value(), 10) << "of unknown length";
  // The rows of the job take what a row of an asset needs.
  ASSERT_TRUE(service_->delete_result(lab_, job.id));
  ASSERT_TRUE(service_->forget(lab_, job.id));
  EXPECT_TRUE(service_->put_asset(lab_, put_blob("new mesh"), "", ""));
}

TEST_F(ResultStoreTest, the_result_of_a_removed_record_stays_until_it_is_deleted_itself) {
  const JobStatus job = finish(lab_, "0123456789");
  ASSERT_TRUE(service_->forget(lab_, job.id));
  EXPECT_EQ(service_->get(lab_, job.id).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(service_->get_grid(lab_, job.result->grid));
  JobRequest equal;
  equal.asset = put(lab_);
  equal.options.voxelize.placement.size = 64;
  EXPECT_TRUE(service_->submit(lab_, equal, {}).value().cached);
  ASSERT_TRUE(service_->delete_result(lab_, job.id));
  EXPECT_EQ(used(lab_), 4);
}

TEST_F(ResultStoreTest, frames_of_a_job_without_a_result_go_with_its_record) {
  const std::string id = submit_moving(lab_);
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  worker.frame(*task, 0, "first");
  ASSERT_TRUE(worker.fail(*task, {ErrorCode::kMalformedMesh, "no", "", ""}));
  ended(lab_, id);
  EXPECT_EQ(used(lab_), 4 + 5);
  ASSERT_TRUE(service_->forget(lab_, id));
  EXPECT_EQ(used(lab_), 4);
  EXPECT_TRUE(goes("first"));
}

}  // namespace
}  // namespace voxeld
