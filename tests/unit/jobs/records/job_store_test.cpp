#include "server/jobs/records/job_store.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/base/sha256.h"
#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/frame_store.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/lists.h"

namespace voxeld {
namespace {

constexpr int kQueueMax = 100;

class JobStoreTest : public ::testing::Test {
 protected:
  void SetUp() override { open(); }
  // As a new process would find it.
  void open() {
    store_.reset();
    assets_.reset();
    database_.reset();
    auto blobs = BlobStore::open(dir_.path());
    ASSERT_TRUE(blobs);
    blobs_.emplace(*std::move(blobs));
    auto database = SqliteDatabase::open(dir_.path() / "jobs.sqlite");
    ASSERT_TRUE(database) << database.error().message();
    database_ = *std::move(database);
    store_ = std::make_unique<JobStore>(
        *database_, [this](std::string_view id) { return blobs_->stat(id).ok(); },
        [this] { return deadline_now_ms_; });
    assets_ = std::make_unique<AssetStore>(*database_, *blobs_);
  }
  std::string put_blob(const std::string& text) {
    auto writer = blobs_->begin(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return writer->finish().value().id;
  }
  std::string put_asset(const std::string& text, const std::string& filename = "bunny.ply") {
    const std::string id = put_blob(text);
    EXPECT_TRUE(
        assets_->put(Caller::open(), {id, static_cast<int64_t>(text.size())}, filename, "", 0));
    return id;
  }
  JobRequest request(const std::string& asset) {
    JobRequest request;
    request.asset = asset;
    return request;
  }
  JobRecord submit(const JobRequest& request, const SubmitOptions& options = {}) {
    auto submitted = store_->submit(Caller::open(), request, options, {kQueueMax, 0});
    EXPECT_TRUE(submitted) << submitted.error().message();
    return submitted->record;
  }
  JobRecord claim() {
    auto claimed = store_->claim("llvmpipe");
    EXPECT_TRUE(claimed && claimed->has_value());
    return **claimed;
  }
  FinishedTask finished(const JobRecord& record, const std::string& text = "result") {
    FinishedTask task;
    task.task = record.status.id;
    task.fence = record.fence;
    task.result.blob = task.result.grid = put_blob(text);
    task.result.bytes = static_cast<int64_t>(text.size());
    task.result.media_type = "application/x-npy";
    task.result.filename = "bunny.npy";
    task.result.meta_json = R"({"voxel_count":7})";
    task.result.warnings = {{"missing-texture", "a.png"}};
    task.timings = {{"parse", 1.0}, {"voxelize", 2.0}};
    return task;
  }
  JobStatus get(const std::string& id) { return store_->get(Caller::open(), id).value().status; }

  testing::TemporaryDir dir_;
  int64_t deadline_now_ms_ = 1'000'000;
  std::optional<BlobStore> blobs_;
  std::unique_ptr<Database> database_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<AssetStore> assets_;
};

TEST_F(JobStoreTest, a_submitted_job_is_queued_with_its_asset_name_and_position) {
  const std::string asset = put_asset("mesh");
  submit(request(asset));
  const JobStatus status = submit(request(asset)).status;
  EXPECT_EQ(status.state, JobState::kQueued);
  EXPECT_TRUE(status.id.starts_with("j-"));
  EXPECT_EQ(status.id.size(), 34u);
  EXPECT_EQ(status.filename, "bunny.ply");
  EXPECT_EQ(status.version, 1);
  EXPECT_EQ(status.queue_position, 2);
  EXPECT_GT(status.created_ms, 0);
  open();
  EXPECT_EQ(get(status.id).queue_position, 2);
}

TEST_F(JobStoreTest, queued_running_done_keeps_result_timings_and_events) {
  SubmitOptions options;
  options.upload_ms = 12.5;
  const std::string id = submit(request(put_asset("mesh")), options).status.id;
  const JobRecord running = claim();
  EXPECT_EQ(running.status.id, id);
  EXPECT_EQ(running.status.state, JobState::kRunning);
  EXPECT_EQ(running.status.attempt, 1);
  EXPECT_EQ(running.status.version, 2);
  EXPECT_EQ(running.fence, 1);
  const auto ended = store_->complete(finished(running), 9);  // progress had got to version 9
  ASSERT_TRUE(ended && ended->has_value());
  open();
  const JobStatus status = get(id);
  EXPECT_EQ(status.state, JobState::kDone);
  EXPECT_EQ(status.version, 10);
  ASSERT_TRUE(status.result);
  EXPECT_EQ(status.result->blob, sha256_id("result"));
  EXPECT_EQ(status.result->grid, sha256_id("result"));
  EXPECT_EQ(status.result->bytes, 6);
  EXPECT_EQ(status.result->meta_json, R"({"voxel_count":7})");
  ASSERT_EQ(status.result->warnings.size(), 1u);
  EXPECT_EQ(status.result->warnings[0].detail, "a.png");
  ASSERT_EQ(status.timings.size(), 4u);
  EXPECT_EQ(status.timings[0].first, "queue");
  EXPECT_EQ(status.timings[1], (std::pair<std::string, double>("upload", 12.5)));
  EXPECT_EQ(status.timings[3], (std::pair<std::string, double>("voxelize", 2.0)));
  EXPECT_FALSE(status.error);
  const auto events = store_->events(Caller::open(), id, 0).value();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].id, 1);
  EXPECT_EQ(events[1].id, 2);
  EXPECT_EQ(events[2].id, 10);
  EXPECT_NE(events[2].data_json.find("\"done\""), std::string::npos);
  EXPECT_EQ(store_->events(Caller::open(), id, 2).value().size(), 1u);
}

TEST_F(JobStoreTest, jobs_are_claimed_in_the_order_of_their_arrival) {
  const std::string asset = put_asset("mesh");
  std::vector<std::string> submitted, claimed;
  for (int i = 0; i < 5; ++i) submitted.push_back(submit(request(asset)).status.id);
  for (int i = 0; i < 5; ++i) claimed.push_back(claim().status.id);
  EXPECT_EQ(claimed, submitted);
  EXPECT_FALSE(store_->claim("llvmpipe").value().has_value());
}

TEST_F(JobStoreTest, two_workers_never_claim_the_same_job) {
  const std::string asset = put_asset("mesh");
  for (int i = 0; i < 60; ++i) submit(request(asset));
  std::vector<std::vector<std::string>> claimed(4);
  std::vector<std::thread> threads;
  for (auto& mine : claimed) {
    threads.emplace_back([&] {
      while (auto job = store_->claim("w").value()) mine.push_back(job->status.id);
    });
  }
  for (auto& thread : threads) thread.join();
  std::set<std::string> all;
  size_t count = 0;
  for (const auto& mine : claimed) {
    all.insert(mine.begin(), mine.end());
    count += mine.size();
  }
  EXPECT_EQ(count, 60u);
  EXPECT_EQ(all.size(), 60u);
}

TEST_F(JobStoreTest, a_failed_job_keeps_code_detail_expected_and_got) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  const JobRecord running = claim();
  const Error error{ErrorCode::kMalformedMesh, "bunny.ply line 3: bad count", "a number", "x"};
  ASSERT_TRUE(store_->fail(id, running.fence, error, 0).value());
  const JobStatus status = get(id);
  EXPECT_EQ(status.state, JobState::kFailed);
  ASSERT_TRUE(status.error);
  EXPECT_EQ(status.error->code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(status.error->detail, error.detail);
  EXPECT_EQ(status.error->expected, "a number");
  EXPECT_EQ(status.error->got, "x");
  EXPECT_GT(status.ended_ms, 0);
}

TEST_F(JobStoreTest, a_report_with_an_older_fence_changes_nothing) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  const JobRecord zombie = claim();
  ASSERT_TRUE(store_->lose_worker(id, zombie.fence, {"signal 9 (Killed)", true}, 2).value());
  EXPECT_EQ(get(id).state, JobState::kQueued);
  EXPECT_FALSE(store_->complete(finished(zombie), 0).value());
  const JobRecord second = claim();
  EXPECT_EQ(second.fence, zombie.fence + 1);
  EXPECT_EQ(second.status.attempt, 2);
  EXPECT_FALSE(store_->complete(finished(zombie, "zombie"), 0).value());
  EXPECT_FALSE(store_->fail(id, zombie.fence, {ErrorCode::kInternal, "late", "", ""}, 0).value());
  EXPECT_FALSE(store_->lose_worker(id, zombie.fence, {"late", true}, 0).value());
  EXPECT_EQ(get(id).state, JobState::kRunning);
  ASSERT_TRUE(store_->complete(finished(second, "good"), 0).value());
  EXPECT_EQ(get(id).result->blob, sha256_id("good"));
  EXPECT_FALSE(store_->complete(finished(second, "again"), 0).value());
}

TEST_F(JobStoreTest, the_third_lost_worker_fails_the_job_with_how_each_ended) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  for (const char* reason :
       {"signal 9 (Killed)", "exit status 1", "signal 11 (Segmentation fault)"}) {
    const JobRecord running = claim();
    ASSERT_TRUE(store_->lose_worker(id, running.fence, {reason, true}, 0).value());
  }
  const JobStatus status = get(id);
  EXPECT_EQ(status.state, JobState::kFailed);
  ASSERT_TRUE(status.error);
  EXPECT_EQ(status.error->code, ErrorCode::kWorkerCrashed);
  EXPECT_EQ(status.error->detail,
            "the job ended 3 workers: signal 9 (Killed), exit status 1, signal 11 (Segmentation "
            "fault)");
  EXPECT_FALSE(store_->claim("w").value().has_value());
}

TEST_F(JobStoreTest, a_daemon_that_stops_does_not_cost_an_attempt) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  for (int i = 0; i < 5; ++i) {
    const JobRecord running = claim();
    EXPECT_EQ(running.status.attempt, 1);
    ASSERT_TRUE(store_->lose_worker(id, running.fence, {}, 0).value());
  }
  EXPECT_EQ(get(id).state, JobState::kQueued);
}

TEST_F(JobStoreTest, a_displaced_job_keeps_the_most_that_it_took) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  int64_t before = 0;
  for (const int64_t bytes : {500, 400, 0, 700}) {
    const JobRecord running = claim();
    EXPECT_EQ(running.status.attempt, 1);
    EXPECT_EQ(running.displaced_bytes, before);
    ASSERT_TRUE(store_->lose_worker(id, running.fence, {"memory", false, bytes}, 0).value());
    before = std::max(before, bytes);
  }
  EXPECT_EQ(claim().displaced_bytes, 700);
}

TEST_F(JobStoreTest, cancelling_a_queued_job_ends_it_and_again_changes_nothing) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  const JobStatus status = store_->cancel(Caller::open(), id).value().record.status;
  EXPECT_EQ(status.state, JobState::kCancelled);
  EXPECT_EQ(status.error->code, ErrorCode::kCancelled);
  EXPECT_EQ(status.error->detail, "the job was cancelled");
  const JobStore::Cancelled again = store_->cancel(Caller::open(), id).value();
  EXPECT_EQ(again.record.status.version, status.version);
  EXPECT_FALSE(again.ended_now);
  EXPECT_FALSE(store_->claim("w").value().has_value());
}

TEST_F(JobStoreTest, a_tenant_whose_records_take_their_share_of_the_disk_waits_for_the_sweep) {
  const std::string asset = put_asset("mesh");
  const std::string first = submit(request(asset)).status.id;
  const int64_t records = store_->usage("").value().record_bytes;
  EXPECT_GT(records, 1024);
  const QueueLimits limits{.in_all = 100, .record_bytes_max = records + 500};
  const auto refused = store_->submit(Caller::open(), request(asset), {}, limits);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooManyRequests);
  EXPECT_EQ(refused.error().expected, "at most " + std::to_string(records + 500) + " bytes");
  EXPECT_EQ(store_->usage("").value().record_bytes, records) << "nothing of it stays";
  ASSERT_TRUE(store_->cancel(Caller::open(), first));
  ASSERT_TRUE(store_->forget(Caller::open(), first));
  EXPECT_TRUE(store_->submit(Caller::open(), request(asset), {},
                             {.in_all = 100, .record_bytes_max = 10'000}));
}

TEST_F(JobStoreTest, cancelling_a_running_job_marks_it_and_it_ends_as_cancelled) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  const JobRecord running = claim();
  EXPECT_TRUE(store_->cancel(Caller::open(), id).value().record.cancel_requested);
  EXPECT_EQ(get(id).state, JobState::kRunning);
  ASSERT_TRUE(
      store_->fail(id, running.fence, {ErrorCode::kCancelled, "the job was cancelled", "", ""}, 0)
          .value());
  EXPECT_EQ(get(id).state, JobState::kCancelled);
}

TEST_F(JobStoreTest, a_cancelled_job_whose_worker_dies_is_not_queued_again) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  const JobRecord running = claim();
  ASSERT_TRUE(store_->cancel(Caller::open(), id));
  ASSERT_TRUE(store_->lose_worker(id, running.fence, {"signal 9 (Killed)", true}, 0).value());
  EXPECT_EQ(get(id).state, JobState::kCancelled);
}

TEST_F(JobStoreTest, unknown_jobs_assets_and_grids_are_not_found) {
  EXPECT_EQ(store_->get(Caller::open(), "j-nothing").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->cancel(Caller::open(), "j-nothing").error().detail, "no such job");
  EXPECT_EQ(store_->events(Caller::open(), "j-nothing", 0).error().code, ErrorCode::kNotFound);
  const auto no_asset =
      store_->submit(Caller::open(), request(sha256_id("never")), {}, {kQueueMax, 0});
  EXPECT_EQ(no_asset.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(no_asset.error().detail, "no such asset");
  JobRequest render;
  render.kind = JobKind::kRender;
  render.grid = put_asset("an asset is not a grid");
  EXPECT_EQ(store_->submit(Caller::open(), render, {}, {kQueueMax, 0}).error().detail,
            "no such grid");
}

TEST_F(JobStoreTest, a_finished_grid_can_be_rendered) {
  submit(request(put_asset("mesh")));
  ASSERT_TRUE(store_->complete(finished(claim()), 0).value());
  EXPECT_TRUE(store_->check_grid(Caller::open(), sha256_id("result")));
  JobRequest render;
  render.kind = JobKind::kRender;
  render.grid = sha256_id("result");
  EXPECT_EQ(submit(render).status.state, JobState::kQueued);
}

TEST_F(JobStoreTest, a_full_queue_refuses_with_the_limit) {
  const std::string asset = put_asset("mesh");
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(store_->submit(Caller::open(), request(asset), {}, {3, 0}));
  }
  const auto refused = store_->submit(Caller::open(), request(asset), {}, {3, 0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kQueueFull);
  EXPECT_EQ(refused.error().message(),
            "too many jobs are waiting; try again later: expected fewer than 3, got 3");
}

TEST_F(JobStoreTest, equal_work_that_is_done_comes_back_at_once_under_this_uploads_name) {
  const std::string asset = put_asset("mesh");
  submit(request(asset));
  ASSERT_TRUE(store_->complete(finished(claim()), 0).value());
  JobRequest again = request(asset);
  again.filename = "rabbit.ply";
  const JobStatus status = submit(again).status;
  EXPECT_EQ(status.state, JobState::kDone);
  EXPECT_TRUE(status.cached);
  EXPECT_EQ(status.result->blob, sha256_id("result"));
  EXPECT_EQ(status.result->filename, "rabbit.npy");
  again.options.use_cache = false;
  EXPECT_EQ(submit(again).status.state, JobState::kQueued);
}

TEST_F(JobStoreTest, a_cached_result_whose_bytes_are_gone_is_computed_again) {
  const std::string asset = put_asset("mesh");
  submit(request(asset));
  ASSERT_TRUE(store_->complete(finished(claim()), 0).value());
  ASSERT_TRUE(blobs_->remove(sha256_id("result")));
  EXPECT_EQ(submit(request(asset)).status.state, JobState::kQueued);
}

TEST_F(JobStoreTest, an_equal_job_that_waited_ends_with_the_first_ones_result) {
  const std::string asset = put_asset("mesh");
  submit(request(asset));
  const std::string second = submit(request(asset)).status.id;
  ASSERT_TRUE(store_->complete(finished(claim()), 0).value());
  const JobRecord answered = claim();
  EXPECT_EQ(answered.status.id, second);
  EXPECT_EQ(answered.status.state, JobState::kDone);
  EXPECT_TRUE(answered.status.cached);
}

TEST_F(JobStoreTest, an_idempotency_key_gives_the_same_job_and_refuses_another_request) {
  SubmitOptions options;
  options.idempotency_key = "key-1";
  JobRequest first = request(put_asset("mesh"));
  const auto one = store_->submit(Caller::open(), first, options, {kQueueMax, 0});
  open();
  const auto two = store_->submit(Caller::open(), first, options, {kQueueMax, 0});
  ASSERT_TRUE(one && two);
  EXPECT_FALSE(one->existed);
  EXPECT_TRUE(two->existed);
  EXPECT_EQ(one->record.status.id, two->record.status.id);
  EXPECT_EQ(store_->known(Caller::open(), first, "key-1").value()->status.id,
            two->record.status.id);
  EXPECT_FALSE(store_->known(Caller::open(), first, "key-2").value());
  first.options.voxelize.placement.size = 64;
  const auto other = store_->submit(Caller::open(), first, options, {kQueueMax, 0});
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kIdempotencyMismatch);
  EXPECT_EQ(other.error().detail, "this Idempotency-Key was used for another request");
}

TEST_F(JobStoreTest, what_an_earlier_process_left_running_is_queued_again_in_its_old_place) {
  const std::string asset = put_asset("mesh");
  const std::string first = submit(request(asset)).status.id;
  const std::string second = submit(request(asset)).status.id;
  const JobRecord running = claim();
  EXPECT_EQ(running.status.id, first);
  open();
  EXPECT_EQ(store_->recover(0).value(), 1);
  const JobStatus status = get(first);
  EXPECT_EQ(status.state, JobState::kQueued);
  EXPECT_EQ(status.queue_position, 1);
  EXPECT_GT(status.version, running.status.version + 1'000'000);
  const JobRecord again = claim();
  EXPECT_EQ(again.status.id, first);
  EXPECT_EQ(again.status.attempt, 1);
  EXPECT_EQ(again.fence, running.fence + 1);
  EXPECT_FALSE(store_->complete(finished(running), 0).value());
  EXPECT_EQ(get(second).queue_position, 1);
}

TEST_F(JobStoreTest, the_time_in_the_queue_is_no_time_in_which_a_lost_job_ran) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  constexpr std::string_view kWaitedOneSecondRanAnHour =
      "UPDATE jobs SET queued_ms = started_ms - 3601000, started_ms = started_ms - 3600000";
  const auto age = [&] {
    ASSERT_TRUE(database_->write(
        [&](SqlConnection& connection) { return connection.run(kWaitedOneSecondRanAnHour); }));
  };
  const JobRecord lost = claim();
  age();
  ASSERT_TRUE(store_->lose_worker(id, lost.fence, {"gone", true}, 0).value());
  claim();
  age();
  open();
  EXPECT_EQ(store_->recover(0).value(), 1);
  const auto done = store_->complete(finished(claim()), 0).value();
  ASSERT_TRUE(done);
  EXPECT_EQ(done->status.timings[0].first, "queue");
  EXPECT_GE(done->status.timings[0].second, 2000);
  EXPECT_LT(done->status.timings[0].second, 3'600'000);
}

// Power loss may have undone its claim, and watchers have seen versions of the progress after that.
TEST_F(JobStoreTest, after_a_restart_nobody_has_seen_the_version_of_a_waiting_job) {
  const std::string id = submit(request(put_asset("mesh"))).status.id;
  open();
  EXPECT_EQ(store_->recover(0).value(), 0) << "it only waits";
  const int64_t version = get(id).version;
  EXPECT_GT(version, 1'000'000);
  EXPECT_EQ(claim().status.version, version + 1);
}

TEST_F(JobStoreTest, a_deadline_passes_by_its_own_clock) {
  JobRequest due = request(put_asset("mesh"));
  due.deadline_ms = 3'600'000;
  const JobRecord record = submit(due);
  EXPECT_EQ(record.deadline_ms, deadline_now_ms_ + 3'600'000);
  EXPECT_EQ(record.status.deadline_at_ms, record.status.created_ms + 3'600'000) << "as announced";
  submit(request(due.asset));
  EXPECT_EQ(store_->expire().value().next_in_ms, 3'600'000);
  deadline_now_ms_ += 3'599'999;
  const auto before = store_->expire();
  EXPECT_TRUE(before->ended.empty());
  EXPECT_EQ(before->next_in_ms, 1);
  deadline_now_ms_ += 1;
  const auto after = store_->expire();
  ASSERT_EQ(after->ended.size(), 1u);
  EXPECT_EQ(after->ended[0].status.id, record.status.id);
  EXPECT_EQ(after->next_in_ms, 0);
}

TEST_F(JobStoreTest, after_a_restart_a_job_has_the_time_that_remained) {
  JobRequest due = request(put_asset("mesh"));
  due.deadline_ms = 3'600'000;
  submit(due);
  const std::string endless = submit(request(due.asset)).status.id;
  deadline_now_ms_ += 600'000;
  open();
  deadline_now_ms_ += 10'800'000;
  ASSERT_TRUE(store_->recover(10'800'000));
  EXPECT_EQ(store_->expire().value().next_in_ms, 3'000'000);
  EXPECT_EQ(store_->get(Caller::open(), endless)->deadline_ms, kNoDeadline);
}

TEST_F(JobStoreTest, recovery_ends_one_shot_jobs_and_those_that_were_being_cancelled) {
  const std::string asset = put_asset("mesh");
  SubmitOptions one_shot;
  one_shot.transient = true;
  const std::string cancelled = submit(request(asset)).status.id;
  const std::string left = submit(request(asset), one_shot).status.id;
  claim();
  ASSERT_TRUE(store_->cancel(Caller::open(), cancelled));
  open();
  EXPECT_EQ(store_->recover(0).value(), 2);
  EXPECT_EQ(get(cancelled).state, JobState::kCancelled);
  EXPECT_EQ(get(left).state, JobState::kCancelled);
  EXPECT_EQ(get(left).error->detail, "the daemon restarted while the client was waiting");
}

TEST_F(JobStoreTest, jobs_are_listed_newest_first_and_by_state) {
  const std::string asset = put_asset("mesh");
  const std::string first = submit(request(asset)).status.id;
  const std::string second = submit(request(asset)).status.id;
  claim();
  const auto all = testing::jobs_of(*store_, Caller::open(), 10);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].status.id, second);
  EXPECT_EQ(testing::jobs_of(*store_, Caller::open(), 1).size(), 1u);
  const auto running = testing::jobs_of(*store_, Caller::open(), 10, JobState::kRunning);
  ASSERT_EQ(running.size(), 1u);
  EXPECT_EQ(running[0].status.id, first);
  EXPECT_EQ(store_->live().value().queued, 1);
}

TEST_F(JobStoreTest, an_inspection_becomes_the_assets_description) {
  JobRequest inspect = request(put_asset("mesh"));
  inspect.kind = JobKind::kInspect;
  submit(inspect);
  ASSERT_TRUE(store_->complete(finished(claim()), 0).value());
  EXPECT_EQ(assets_->get(Caller::open(), inspect.asset).value().description_json,
            R"({"voxel_count":7})");
}

TEST_F(JobStoreTest, a_deleted_asset_is_gone_and_comes_back_with_an_upload) {
  const std::string id = put_asset("mesh");
  ASSERT_TRUE(assets_->mark_deleted(Caller::open(), id));
  EXPECT_EQ(assets_->get(Caller::open(), id).error().code, ErrorCode::kGone);
  EXPECT_EQ(assets_->mark_deleted(Caller::open(), id).error().code, ErrorCode::kGone);
  EXPECT_EQ(store_->submit(Caller::open(), request(id), {}, {kQueueMax, 0}).error().code,
            ErrorCode::kGone);
  EXPECT_TRUE(assets_->list(Caller::open(), {}, [](const Asset&) {
    ADD_FAILURE() << "there is one left";
    return true;
  }));
  EXPECT_EQ(assets_->remove_unneeded().value(), 1);
  EXPECT_FALSE(blobs_->stat(id));
  put_asset("mesh");
  EXPECT_EQ(assets_->get(Caller::open(), id).value().filename, "bunny.ply");
  EXPECT_EQ(assets_->get(Caller::open(), id).value().bytes, 4);
}

TEST_F(JobStoreTest, an_asset_whose_blob_went_away_during_the_upload_must_be_sent_again) {
  const std::string id = put_blob("mesh");
  ASSERT_TRUE(blobs_->remove(id));
  const auto refused = assets_->put(Caller::open(), {id, 4}, "a.ply", "", 0);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
}

TEST_F(JobStoreTest, the_blob_of_a_deleted_asset_stays_while_a_live_job_or_a_result_needs_it) {
  const std::string asset = put_asset("mesh");
  submit(request(asset));
  ASSERT_TRUE(assets_->mark_deleted(Caller::open(), asset));
  EXPECT_EQ(assets_->remove_unneeded().value(), 0);
  const JobRecord running = claim();
  EXPECT_EQ(assets_->remove_unneeded().value(), 0);
  ASSERT_TRUE(store_->complete(finished(running), 0).value());
  EXPECT_EQ(assets_->remove_unneeded().value(), 1);
  // Somebody uploads the result as an asset and deletes it: the job's result stays.
  const std::string result = put_asset("result", "");
  ASSERT_TRUE(assets_->mark_deleted(Caller::open(), result));
  EXPECT_EQ(assets_->remove_unneeded().value(), 1);
  EXPECT_TRUE(blobs_->stat(result));
  EXPECT_EQ(assets_->remove_unneeded().value(), 0) << "it is looked at once";
}

TEST_F(JobStoreTest, frames_of_an_earlier_claim_are_void) {
  FrameStore frames(*database_, *blobs_);
  JobRequest moving = request(put_asset("mesh"));
  moving.options.animation.animation = "0";
  const std::string id = submit(moving).status.id;
  const JobRecord first = claim();
  const TaskFrame frame{id, first.fence, 0, 0.125, "", 7, "sha256-c"};
  const auto listed = frames.add(frame, {"sha256-1", 1}, 9, 0);
  ASSERT_TRUE(listed && *listed) << listed.error().message();
  EXPECT_EQ(**listed, 1);
  ASSERT_TRUE(store_->lose_worker(id, first.fence, {"gone", true}, 0));
  ASSERT_TRUE(frames.add(frame, {"sha256-2", 1}, 9, 0));
  EXPECT_FALSE(*frames.add(frame, {"sha256-2", 1}, 9, 0));  // queued: nobody owns it
  const JobRecord second = claim();
  EXPECT_FALSE(*frames.add(frame, {"sha256-2", 1}, 9, 0));
  EXPECT_EQ(frames.of_job(id)->at(0).frame.grid, "sha256-1");
  TaskFrame again = frame;
  again.fence = second.fence;
  EXPECT_EQ(**frames.add(again, {"sha256-3", 1}, 9, 0), 1);
  const auto now = frames.of_job(id);
  ASSERT_EQ(now->size(), 1u);
  EXPECT_EQ(now->at(0).frame.grid, "sha256-3");
  EXPECT_EQ(now->at(0).frame.time_s, 0.125);
  EXPECT_EQ(now->at(0).frame.voxel_count, 7u);
  EXPECT_EQ(get(id).frames_done, 1);
  EXPECT_EQ(get(id).frames_total, 9);
  ASSERT_TRUE(store_->check_grid(Caller::open(), "sha256-3"));
  EXPECT_FALSE(store_->check_grid(Caller::open(), "sha256-1"));
}

}  // namespace
}  // namespace voxeld
