// Removal of stored data: which data, by which thread, and data that is never removed.
#include "server/jobs/retention/retention.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/records/frame_store.h"
#include "server/jobs/records/job_store.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr int64_t kEndOfTimeMs = std::numeric_limits<int64_t>::max();

class RetentionTest : public ::testing::Test {
 protected:
  std::string put_blob(const std::string& text) {
    auto writer = blobs_.begin(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return writer->finish().value().id;
  }
  std::string put_asset(const std::string& text) {
    const std::string id = put_blob(text);
    EXPECT_TRUE(
        assets_.put(Caller::open(), {id, static_cast<int64_t>(text.size())}, "a.ply", "", 0));
    return id;
  }
  JobStatus submit(const JobRequest& request) {
    auto submitted = jobs_.submit(Caller::open(), request, {}, {100, 0});
    EXPECT_TRUE(submitted) << submitted.error().message();
    return submitted->record.status;
  }
  JobStatus submit(const std::string& asset, bool use_cache = true) {
    JobRequest request;
    request.asset = asset;
    request.options.use_cache = use_cache;
    return submit(request);
  }
  // Claims the next job and ends it with `text`.
  JobStatus run(const std::string& text) {
    const JobRecord record = jobs_.claim("cpu").value().value();
    FinishedTask task;
    task.task = record.status.id;
    task.fence = record.fence;
    task.result.blob = task.result.grid = put_blob(text);
    task.result.media_type = "application/x-npy";
    task.result.meta_json = "{}";
    return jobs_.complete(task, 1).value().value().status;
  }
  JobStatus made(const std::string& mesh, const std::string& text) {
    submit(put_asset(mesh), /*use_cache=*/false);
    return run(text);
  }
  // By the clock of retention, all is from its beginning.
  void age_all() { ASSERT_TRUE(retention_.note_ages(1)); }
  bool stored(const std::string& text) { return blobs_.stat(sha256_id(text)).ok(); }
  Status sql(const std::string& text) {
    return database_->write([&](SqlConnection& c) { return c.run(text); });
  }
  int64_t blob_bytes() {
    auto reader = database_->read();
    auto sum = (*reader)->query("SELECT SUM(bytes) FROM holdings");
    EXPECT_TRUE(sum && sum->step());
    return sum->int64(0);
  }
  int64_t count(const std::string& from) {
    auto reader = database_->read();
    auto rows = (*reader)->query("SELECT COUNT(*) FROM " + from);
    EXPECT_TRUE(rows && rows->step());
    return rows->int64(0);
  }

  testing::TemporaryDir dir_;
  BlobStore blobs_ = BlobStore::open(dir_.path()).value();
  std::unique_ptr<Database> database_ = SqliteDatabase::open(dir_.path() / "jobs.sqlite").value();
  JobStore jobs_{*database_, [this](std::string_view id) { return blobs_.is_usable(id); },
                 unix_time_ms};
  AssetStore assets_{*database_, blobs_};
  FrameStore frames_{*database_, blobs_};
  Retention retention_{*database_, blobs_};
};

TEST_F(RetentionTest, a_file_goes_when_what_is_committed_does_not_need_it_either) {
  const std::string asset = put_asset("mesh");
  // The deletion may still be rolled back, with the whole batch: the file could not.
  ASSERT_TRUE(database_->write([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(connection.run("UPDATE assets SET deleted_ms = 1"));
    VOXELD_ASSIGN(const auto gone,
                  remove_blobs(connection, *database_, {asset},
                               [this](const std::string& id) { return blobs_.remove(id); }));
    EXPECT_TRUE(gone.empty());
    return {};
  }));
  EXPECT_TRUE(stored("mesh"));
  EXPECT_EQ(assets_.remove_unneeded().value(), 1);
  EXPECT_FALSE(stored("mesh"));
}

TEST_F(RetentionTest, results_expire_by_their_last_use_and_are_gone_then) {
  const JobStatus old = made("mesh", "old"), used = made("mesh", "used");
  ASSERT_TRUE(sql("UPDATE results SET used_ms = seq"));
  retention_.touch(used.result->blob);
  ASSERT_TRUE(retention_.flush());
  EXPECT_EQ(retention_.expire_results(1000).value(), 1);
  EXPECT_FALSE(stored("old"));
  EXPECT_TRUE(stored("used"));
  EXPECT_TRUE(stored("mesh"));  // assets are not results
  // Known, though its bytes are gone.
  EXPECT_EQ(jobs_.check_grid(Caller::open(), old.result->grid).error().code, ErrorCode::kGone);
  JobRequest request;
  request.kind = JobKind::kExport;
  request.grid = old.result->grid;
  EXPECT_EQ(jobs_.submit(Caller::open(), request, {}, {100, 0}).error().code, ErrorCode::kGone);
  EXPECT_EQ(retention_.expire_results(1000).value(), 0);
}

TEST_F(RetentionTest, all_results_of_one_content_are_used_however_many) {
  constexpr int kEqual = 150;  // in several transactions
  const std::string blob = made("mesh", "same").result->blob;
  for (int i = 1; i < kEqual; ++i) made("mesh", "same");
  made("mesh", "other");
  ASSERT_TRUE(sql("UPDATE results SET used_ms = 1"));
  retention_.touch(blob);
  ASSERT_TRUE(retention_.flush());
  EXPECT_EQ(count("results WHERE used_ms > 1"), kEqual);
}

TEST_F(RetentionTest, a_use_is_noted_where_the_last_one_is_older_than_ten_minutes) {
  constexpr int64_t kMinuteMs = 60'000;
  const std::string recent = made("mesh", "recent").result->blob;
  const std::string old = made("mesh", "old").result->blob;
  const std::string now = std::to_string(unix_time_ms());
  const auto set_age = [&](const std::string& blob, int64_t age_ms) {
    ASSERT_TRUE(sql("UPDATE results SET used_ms = " + now + " - " + std::to_string(age_ms) +
                    " WHERE blob = '" + blob + "'"));
  };
  set_age(recent, 5 * kMinuteMs);
  set_age(old, 15 * kMinuteMs);
  for (const std::string& blob : {recent, old}) retention_.touch(blob);
  ASSERT_TRUE(retention_.flush());
  EXPECT_EQ(count("results WHERE used_ms = " + now + " - " + std::to_string(5 * kMinuteMs)), 1);
  EXPECT_EQ(count("results WHERE used_ms >= " + now), 1);
}

TEST_F(RetentionTest, a_use_is_noted_after_the_clock_was_set_back) {
  const std::string blob = made("mesh", "made").result->blob;
  ASSERT_TRUE(sql("UPDATE results SET used_ms = used_ms + 86400000"));
  age_all();
  ASSERT_EQ(count("results WHERE aged_ms = 1"), 1);
  const std::string now = std::to_string(unix_time_ms());
  retention_.touch(blob);
  ASSERT_TRUE(retention_.flush());
  EXPECT_EQ(count("results WHERE aged_ms = 0"), 1) << "it is as young as its last use";
  EXPECT_EQ(count("results WHERE used_ms < " + now + " + 43200000"), 1);
}

TEST_F(RetentionTest, no_more_results_go_than_make_the_room_that_is_wanted) {
  for (const char* text : {"one", "two", "three"}) made("mesh", text);
  ASSERT_TRUE(sql("UPDATE results SET used_ms = seq"));
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs, 4).value(), 2);  // three bytes are not enough
  EXPECT_FALSE(stored("one"));
  EXPECT_FALSE(stored("two"));
  EXPECT_TRUE(stored("three"));
}

TEST_F(RetentionTest, results_that_seem_used_in_the_future_go_first) {
  for (const char* text : {"before", "earlier", "since"}) made("mesh", text);
  ASSERT_TRUE(sql("UPDATE results SET used_ms = used_ms + 86400000 + seq WHERE seq < 3"));
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs, 1).value(), 1);
  EXPECT_FALSE(stored("before"));
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 1);
  EXPECT_FALSE(stored("earlier"));
  EXPECT_TRUE(stored("since"));
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 1);
}

TEST_F(RetentionTest, assets_of_several_tenants_have_their_bytes_once) {
  put_asset("mesh");
  const std::string other = put_asset("other");
  ASSERT_TRUE(
      sql("INSERT INTO assets (id, filename, content_type, bytes, created_ms, tenant)"
          " SELECT id, filename, content_type, bytes, created_ms, 'lab' FROM assets"));
  EXPECT_EQ(retention_.asset_bytes().value(), 9);
  ASSERT_TRUE(sql("UPDATE assets SET deleted_ms = 1 WHERE id = '" + other + "'"));
  EXPECT_EQ(retention_.asset_bytes().value(), 4);
}

TEST_F(RetentionTest, an_expired_result_is_computed_again) {
  made("mesh", "result");
  EXPECT_TRUE(submit(sha256_id("mesh")).cached);
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 1);
  EXPECT_FALSE(submit(sha256_id("mesh")).cached);
  run("result");
  EXPECT_TRUE(stored("result"));
  EXPECT_TRUE(submit(sha256_id("mesh")).cached);
}

TEST_F(RetentionTest, what_a_live_job_works_on_stays) {
  const JobStatus grid = made("mesh", "grid");
  JobRequest request;
  request.kind = JobKind::kExport;
  request.grid = grid.result->grid;
  submit(request);
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 0);
  EXPECT_TRUE(stored("grid"));
  run("export");
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 2);
  EXPECT_FALSE(stored("grid"));
  EXPECT_FALSE(stored("export"));
}

TEST_F(RetentionTest, bytes_that_another_result_or_asset_has_stay) {
  made("mesh", "same");
  made("mesh", "same");
  put_asset("same");
  ASSERT_TRUE(sql("UPDATE results SET used_ms = seq"));
  EXPECT_EQ(retention_.expire_results(2).value(), 1);
  EXPECT_TRUE(stored("same"));
  EXPECT_EQ(retention_.expire_results(3).value(), 1);
  EXPECT_TRUE(stored("same"));
  ASSERT_TRUE(assets_.mark_deleted(Caller::open(), sha256_id("same")));
  EXPECT_EQ(assets_.remove_unneeded().value(), 1);
  EXPECT_FALSE(stored("same"));
}

// Else it would tell that somebody else has the same bytes.
TEST_F(RetentionTest, a_deleted_asset_is_forgotten_whether_or_not_others_have_its_bytes) {
  const Caller lab = Caller::tenant("lab", false), studio = Caller::tenant("studio", false);
  const std::string ours = put_blob("ours"), mine = put_blob("mine");
  for (const std::string& id : {ours, mine}) {
    ASSERT_TRUE(assets_.put(lab, {id, 4}, "a.ply", "", 0));
  }
  ASSERT_TRUE(assets_.put(studio, {ours, 4}, "a.ply", "", 0));
  for (const std::string& id : {ours, mine}) ASSERT_TRUE(assets_.mark_deleted(lab, id));
  EXPECT_EQ(assets_.remove_unneeded().value(), 2);
  age_all();
  ASSERT_TRUE(retention_.trim_jobs(kEndOfTimeMs, 100));
  for (const std::string& id : {ours, mine}) {
    EXPECT_EQ(assets_.get(lab, id).error().code, ErrorCode::kNotFound) << id;
  }
  EXPECT_TRUE(assets_.get(studio, ours));
  EXPECT_TRUE(stored("ours"));
  ASSERT_TRUE(assets_.mark_deleted(studio, ours));
  EXPECT_EQ(assets_.remove_unneeded().value(), 1);
  EXPECT_FALSE(stored("ours"));
}

TEST_F(RetentionTest, what_expired_is_not_counted_as_kept) {
  submit(put_asset("mesh"), /*use_cache=*/false);
  const JobRecord record = jobs_.claim("cpu").value().value();
  TaskFrame frame;
  frame.task = record.status.id;
  frame.fence = record.fence;
  ASSERT_TRUE(frames_.add(frame, {put_blob("frame"), 5}, 1, 0).value());
  FinishedTask task;
  task.task = record.status.id;
  task.fence = record.fence;
  task.result.blob = put_blob("result");
  task.result.bytes = 6;
  task.result.grid = put_blob("grid");
  task.grid_bytes = 4;
  task.result.meta_json = "{}";
  ASSERT_TRUE(jobs_.complete(task, 1).value());
  EXPECT_EQ(blob_bytes(), 4 + 5 + 6 + 4);  // the mesh, the frame, the result
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 1);
  age_all();
  retention_.expire_frames(kEndOfTimeMs).value();
  EXPECT_EQ(blob_bytes(), 4);
  // Its rows go later, and are not taken off twice.
  age_all();
  EXPECT_EQ(retention_.trim_jobs(kEndOfTimeMs, 100).value(), 1);
  EXPECT_EQ(count("results"), 0);
  EXPECT_EQ(blob_bytes(), 4);
  EXPECT_EQ(jobs_.usage("").value().record_bytes, 0);
}

TEST_F(RetentionTest, over_their_share_the_oldest_records_of_a_tenant_go_and_no_others) {
  const Caller other = Caller::tenant("other", false);
  const std::string asset = put_asset("mesh");
  std::vector<std::string> ended;
  for (int i = 0; i < 10; ++i) ended.push_back(made("mesh", "result " + std::to_string(i)).id);
  const std::string queued = submit(asset, /*use_cache=*/false).id;
  ASSERT_TRUE(assets_.put(other, {asset, 4}, "a.ply", "", 0));
  JobRequest theirs;
  theirs.asset = asset;
  const std::string of_other = jobs_.submit(other, theirs, {}, {100, 0}).value().record.status.id;
  ASSERT_TRUE(jobs_.cancel(other, of_other));
  const int64_t all = jobs_.usage("").value().record_bytes;
  EXPECT_EQ(retention_.trim_records(all).value(), 0) << "within the share";
  EXPECT_EQ(retention_.trim_records(all - 1).value(), 10);
  for (const std::string& id : ended) EXPECT_FALSE(jobs_.get(Caller::open(), id)) << id;
  EXPECT_TRUE(jobs_.get(Caller::open(), queued));
  EXPECT_TRUE(jobs_.get(other, of_other));
  EXPECT_TRUE(stored("result 3")) << "results stay";
  EXPECT_EQ(count("job_events"), 1 + 2);
  EXPECT_EQ(retention_.trim_records(1).value(), 1) << "of the other tenant";
  EXPECT_EQ(retention_.trim_records(1).value(), 0) << "live jobs stay";
}

TEST_F(RetentionTest, what_remembers_deleted_assets_is_a_record_of_its_tenant) {
  for (const char* text : {"a", "b", "c"}) {
    ASSERT_TRUE(assets_.mark_deleted(Caller::open(), put_asset(text)));
  }
  const std::string kept = put_asset("kept");
  EXPECT_EQ(assets_.remove_unneeded().value(), 3);
  const int64_t records = jobs_.usage("").value().record_bytes;
  EXPECT_GE(records, 3 * 384);
  EXPECT_EQ(retention_.trim_records(records).value(), 0);
  EXPECT_EQ(retention_.trim_records(records - 1).value(), 3);
  EXPECT_EQ(jobs_.usage("").value().record_bytes, 0);
  EXPECT_TRUE(assets_.get(Caller::open(), kept));
}

TEST_F(RetentionTest, the_record_of_a_deleted_bundle_goes_with_the_rows_of_its_files) {
  const Caller lab = Caller::tenant("lab", false), studio = Caller::tenant("studio", false);
  const std::string mesh = put_blob("mesh"), bundle = put_blob("manifest");
  for (const Caller& caller : {lab, studio}) {
    ASSERT_TRUE(assets_.put(caller, {mesh, 4}, "a.ply", "", 0));
    ASSERT_TRUE(
        assets_.put_bundle(caller, {bundle, 8}, "a.bundle.json", {BundleFile{"a.ply", mesh}}, 0));
  }
  ASSERT_TRUE(assets_.mark_deleted(lab, bundle));
  EXPECT_EQ(assets_.remove_unneeded().value(), 1);
  EXPECT_EQ(retention_.trim_records(1).value(), 1);
  EXPECT_EQ(count("bundle_files WHERE tenant = 'lab'"), 0);
  EXPECT_EQ(count("bundle_files WHERE tenant = 'studio'"), 1);
}

TEST_F(RetentionTest, frames_of_failed_jobs_expire) {
  submit(put_asset("mesh"));
  const JobRecord record = jobs_.claim("cpu").value().value();
  TaskFrame frame;
  frame.task = record.status.id;
  frame.fence = record.fence;
  frame.content_hash = "h";
  ASSERT_TRUE(frames_.add(frame, {put_blob("frame"), 5}, 2, 0).value());
  EXPECT_EQ(retention_.expire_frames(kEndOfTimeMs).value(), 0);  // it runs
  ASSERT_TRUE(jobs_.fail(record.status.id, record.fence, {ErrorCode::kInternal, "no", "", ""}, 1));
  age_all();
  EXPECT_EQ(retention_.expire_frames(kEndOfTimeMs).value(), 1);
  EXPECT_FALSE(stored("frame"));
  EXPECT_EQ(retention_.expire_frames(kEndOfTimeMs).value(), 0);
}

TEST_F(RetentionTest, assets_expire_unless_a_job_used_them_meanwhile) {
  const std::string old = put_asset("old"), used = put_asset("used");
  age_all();
  submit(used);
  ASSERT_TRUE(retention_.note_ages(2000));
  EXPECT_EQ(retention_.expire_assets(1000, 100).value(), 1);
  EXPECT_EQ(assets_.get(Caller::open(), old).error().code, ErrorCode::kGone);
  EXPECT_TRUE(assets_.get(Caller::open(), used));
  EXPECT_EQ(assets_.remove_unneeded().value(), 1);
  EXPECT_FALSE(stored("old"));
}

TEST_F(RetentionTest, jobs_are_forgotten_with_all_rows_but_their_results_serve_equal_ones) {
  const JobStatus job = made("mesh", "result");
  submit(put_asset("waits"));
  EXPECT_EQ(retention_.trim_jobs(1000, 100).value(), 0);
  age_all();
  EXPECT_EQ(retention_.trim_jobs(kEndOfTimeMs, 100).value(), 1);
  EXPECT_EQ(jobs_.get(Caller::open(), job.id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(count("jobs"), 1);
  EXPECT_EQ(count("job_events"), 1);
  EXPECT_TRUE(stored("result"));
  EXPECT_TRUE(submit(sha256_id("mesh")).cached);
  // The last job that refers to it takes the expired row along.
  EXPECT_EQ(retention_.expire_results(kEndOfTimeMs).value(), 1);
  age_all();
  EXPECT_EQ(retention_.trim_jobs(kEndOfTimeMs, 100).value(), 1);
  EXPECT_EQ(count("results"), 0);
}

TEST_F(RetentionTest, a_key_of_a_job_that_was_forgotten_is_free_again) {
  SubmitOptions options;
  options.idempotency_key = "key";
  JobRequest request;
  request.asset = put_asset("mesh");
  const auto first = jobs_.submit(Caller::open(), request, options, {100, 0});
  run("result");
  ASSERT_TRUE(sql("DELETE FROM jobs"));
  const auto second = jobs_.submit(Caller::open(), request, options, {100, 0});
  ASSERT_TRUE(second) << second.error().message();
  EXPECT_FALSE(second->existed);
  EXPECT_NE(second->record.status.id, first->record.status.id);
}

TEST_F(RetentionTest, blobs_that_nothing_names_go_to_quarantine_unless_they_are_being_registered) {
  put_blob("cut off");
  put_asset("mesh");
  auto writer = blobs_.begin(100);
  ASSERT_TRUE(writer);
  const std::vector<uint8_t> bytes = {1, 2, 3};
  ASSERT_TRUE(writer->append(bytes));
  const BlobInfo pinned = writer->finish().value();
  EXPECT_EQ(retention_.quarantine_orphans("2026-11-22").value(), 1);
  EXPECT_FALSE(stored("cut off"));
  EXPECT_TRUE(stored("mesh"));
  EXPECT_TRUE(blobs_.stat(pinned.id));
}

TEST_F(RetentionTest, what_was_deleted_goes_and_does_not_wait_in_quarantine) {
  put_asset("mesh");
  ASSERT_TRUE(assets_.mark_deleted(Caller::open(), sha256_id("mesh")));
  EXPECT_EQ(retention_.quarantine_orphans("2026-11-22").value(), 0);
  EXPECT_FALSE(stored("mesh"));
  EXPECT_TRUE(Quarantine(dir_.path()).list()->empty());
}

TEST_F(RetentionTest, a_blob_is_back_from_quarantine_when_a_row_names_it) {
  put_blob("unknown");
  const std::string id = put_blob("named later");
  EXPECT_EQ(retention_.quarantine_orphans("2026-11-22").value(), 2);
  EXPECT_EQ(retention_.restore_quarantined().value(), 0);
  ASSERT_TRUE(
      sql("INSERT INTO assets (tenant, id, filename, content_type, bytes, created_ms)"
          " VALUES ('', '" +
          id + "', '', '', 11, 1)"));
  EXPECT_EQ(retention_.restore_quarantined().value(), 1);
  EXPECT_TRUE(stored("named later"));
  EXPECT_FALSE(stored("unknown"));
}

TEST_F(RetentionTest, an_upload_that_came_to_nothing_goes_at_the_next_look) {
  put_blob("cut off");
  put_asset("mesh");
  EXPECT_EQ(retention_.remove_suspects().value(), 1);
  EXPECT_FALSE(stored("cut off"));
  EXPECT_TRUE(stored("mesh"));
  EXPECT_EQ(retention_.remove_suspects().value(), 0);
}

TEST_F(RetentionTest, what_could_not_go_while_it_was_uploaded_again_goes_later) {
  const std::string id = put_asset("mesh");
  auto writer = blobs_.begin(100);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->append(std::vector<uint8_t>{'m', 'e', 's', 'h'}));
  {
    const BlobInfo again = writer->finish().value();
    ASSERT_EQ(again.id, id);
    ASSERT_TRUE(assets_.mark_deleted(Caller::open(), id));
    EXPECT_EQ(assets_.remove_unneeded().value(), 0);
    EXPECT_EQ(retention_.remove_suspects().value(), 0);
    EXPECT_TRUE(stored("mesh"));
  }
  EXPECT_EQ(retention_.remove_suspects().value(), 1);
  EXPECT_FALSE(stored("mesh"));
}

TEST_F(RetentionTest, the_size_of_the_store_is_known) {
  put_blob("12345");
  put_blob("12345");
  EXPECT_EQ(blobs_.bytes(), 5);
  ASSERT_TRUE(blobs_.recount());
  EXPECT_EQ(blobs_.bytes(), 5);
  ASSERT_TRUE(blobs_.remove(sha256_id("12345")));
  EXPECT_EQ(blobs_.bytes(), 0);
}

}  // namespace
}  // namespace voxeld
