// Places in the queue: how many of them a tenant can have, and the counters that say so.
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/retention/retention.h"
#include "tests/unit/jobs/lists.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

class QueueShare : public testing::ServiceTest {
 protected:
  void SetUp() override {
    queued_jobs_max_ = 30;
    start();
  }
  Result<JobStatus> submit_for(const std::string& tenant) {
    const Caller caller = Caller::tenant(tenant, false);
    JobRequest request;
    request.asset = service_->put_asset(caller, put_blob("mesh"), "a.ply", "").value().id;
    return service_->submit(caller, request, {});
  }
  // How many jobs of the tenant are taken before one is refused.
  int fill(const std::string& tenant, Error& refusal) {
    for (int taken = 0;; ++taken) {
      const auto status = submit_for(tenant);
      if (status) continue;
      refusal = status.error();
      return taken;
    }
  }
};

TEST_F(QueueShare, one_of_several_tenants_leaves_half_of_the_places_to_others) {
  is_queue_shared_ = true;
  Error refusal;
  EXPECT_EQ(fill("greedy", refusal), 15);
  EXPECT_EQ(refusal.code, ErrorCode::kTooManyRequests);
  EXPECT_EQ(refusal.message(),
            "this tenant's share of the queue is used up; try again later: expected fewer jobs of "
            "the tenant than the 15 places that are free, got 15");
  EXPECT_EQ(fill("second", refusal), 8);
  EXPECT_EQ(fill("third", refusal), 4);
  EXPECT_EQ(fill("fourth", refusal), 2);
  EXPECT_EQ(fill("fifth", refusal), 1) << "whoever has nothing in the queue finds a place";
  EXPECT_EQ(service_->queued_jobs(), 30);
  // Now it is full, also for who has none.
  EXPECT_EQ(fill("sixth", refusal), 0);
  EXPECT_EQ(refusal.code, ErrorCode::kQueueFull);
  EXPECT_EQ(refusal.expected, "fewer than 30");
}

TEST_F(QueueShare, places_that_become_free_are_shared_anew) {
  is_queue_shared_ = true;
  Error refusal;
  fill("greedy", refusal);
  std::vector<std::string> others;
  for (int i = 0; i < 8; ++i) others.push_back(submit_for("other")->id);
  EXPECT_EQ(submit_for("greedy").error().code, ErrorCode::kTooManyRequests);
  for (const std::string& id : others) {
    ASSERT_TRUE(service_->cancel(Caller::tenant("other", false), id));
  }
  EXPECT_EQ(submit_for("greedy").error().code, ErrorCode::kTooManyRequests)
      << "it has as many as are free";
  const auto own =
      testing::jobs_of(*service_, Caller::tenant("greedy", false), 1, JobState::kQueued);
  ASSERT_TRUE(service_->cancel(Caller::tenant("greedy", false), own[0].id));
  EXPECT_TRUE(submit_for("greedy"));
}

TEST_F(QueueShare, who_is_alone_has_the_whole_queue) {
  Error refusal;
  EXPECT_EQ(fill("alone", refusal), 30);
  EXPECT_EQ(refusal.code, ErrorCode::kQueueFull);
}

class LiveJobsTest : public ::testing::Test {
 protected:
  void SetUp() override { open(); }
  // As a process would after one that ended anyhow.
  void open() {
    store_.reset();
    database_.reset();
    blobs_.emplace(BlobStore::open(dir_.path()).value());
    database_ = SqliteDatabase::open(dir_.path() / "jobs.sqlite").value();
    store_ = std::make_unique<JobStore>(
        *database_, [](std::string_view) { return true; }, [this] { return deadline_now_ms_; });
  }
  JobRequest request(const Caller& caller) {
    auto writer = blobs_->begin(100);
    const std::string text = "mesh";
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    const BlobInfo blob = writer->finish().value();
    EXPECT_TRUE(AssetStore(*database_, *blobs_).put(caller, blob, "a.ply", "", 0));
    JobRequest request;
    request.asset = blob.id;
    request.options.use_cache = false;
    return request;
  }
  // The rows themselves, counted; '*' has all.
  std::map<std::string, std::pair<int64_t, int64_t>> counted() {
    auto reader = database_->read().value();
    auto rows = reader
                    ->query(
                        "SELECT tenant, SUM(state = 'queued'), SUM(state = 'running') FROM jobs"
                        " GROUP BY tenant")
                    .value();
    std::map<std::string, std::pair<int64_t, int64_t>> counts;
    while (rows.step().value()) {
      counts[rows.text(0)] = {rows.int64(1), rows.int64(2)};
      counts["*"].first += rows.int64(1);
      counts["*"].second += rows.int64(2);
    }
    return counts;
  }
  void expect_counted(const std::string& after) {
    for (const auto& [tenant, expected] : counted()) {
      auto reader = database_->read().value();
      const LiveJobs live = live_jobs(*reader, tenant).value();
      EXPECT_EQ(std::pair(live.queued, live.running), expected) << tenant << " after " << after;
    }
  }

  testing::TemporaryDir dir_;
  std::optional<BlobStore> blobs_;
  std::unique_ptr<Database> database_;
  int64_t deadline_now_ms_ = 1'000'000;
  std::unique_ptr<JobStore> store_;
};

TEST_F(LiveJobsTest, the_counters_are_the_rows_whatever_happens_to_jobs) {
  std::mt19937 random(7);
  std::vector<JobRecord> running;
  std::vector<std::pair<Caller, std::string>> queued;
  const std::vector<Caller> callers = {Caller::open(), Caller::tenant("lab", false),
                                       Caller::tenant("studio", false)};
  const auto take_running = [&] {
    JobRecord job = running.back();
    running.pop_back();
    return job;
  };
  for (int step = 0; step < 300; ++step) {
    const auto what = random() % 11;
    if (what < 4) {
      const Caller& caller = callers[random() % callers.size()];
      JobRequest job = request(caller);
      if (what == 0) job.deadline_ms = 1;
      auto submitted = store_->submit(caller, job, {}, {100, 0});
      ASSERT_TRUE(submitted) << submitted.error().message();
      queued.emplace_back(caller, submitted->record.status.id);
    } else if (what == 4) {
      auto claimed = store_->claim("cpu");
      ASSERT_TRUE(claimed);
      if (*claimed) running.push_back(**claimed);
    } else if (what == 5 && !queued.empty()) {
      ASSERT_TRUE(store_->cancel(queued.back().first, queued.back().second));
      queued.pop_back();
    } else if (what == 6 && !running.empty()) {
      const JobRecord job = take_running();
      ASSERT_TRUE(store_->fail(job.status.id, job.fence, {ErrorCode::kInternal, "x", "", ""}, 0));
    } else if (what == 7 && !running.empty()) {
      const JobRecord job = take_running();
      ASSERT_TRUE(store_->lose_worker(job.status.id, job.fence, {"gone", true}, 0));
    } else if (what == 8 && !running.empty()) {
      const JobRecord job = take_running();
      ASSERT_TRUE(store_->preempt({job.status.id, job.fence, 0, 0, {}}, 0));
    } else if (what == 9) {
      deadline_now_ms_ += 10;
      ASSERT_TRUE(store_->expire());
    } else if (what == 10) {
      // Changes that are undone: of one operation, and of its whole batch.
      for (const bool is_whole : {false, true}) {
        const Status undone = database_->write([&](SqlConnection& connection) -> Status {
          VOXELD_TRY(connection.run("UPDATE jobs SET state = 'running' WHERE state = 'queued'"));
          VOXELD_TRY(connection.run("DELETE FROM jobs WHERE state = 'done'"));
          if (is_whole) VOXELD_TRY(connection.run("ROLLBACK"));
          return Error{ErrorCode::kInternal, "undo it", "", ""};
        });
        ASSERT_FALSE(undone);
      }
    }
    if (step % 60 == 59) {
      open();
      ASSERT_TRUE(store_->recover(0));
      running.clear();
      Retention retention(*database_, *blobs_);
      ASSERT_TRUE(retention.note_ages(step));
      ASSERT_TRUE(retention.trim_jobs(step + 1, Retention::kAllBytes));
    }
    expect_counted("step " + std::to_string(step) + ", " + std::to_string(what));
    if (HasFailure()) return;
  }
  EXPECT_GT(counted()["*"].first, 0);
}

TEST_F(LiveJobsTest, a_place_in_the_queue_is_counted_from_either_end) {
  std::vector<std::string> ids;
  const Caller lab = Caller::tenant("lab", false);
  for (int i = 0; i < 9; ++i) {
    const Caller& caller = i % 2 == 0 ? lab : Caller::open();
    const auto submitted = store_->submit(caller, request(caller), {}, {100, 0}).value();
    EXPECT_EQ(submitted.record.status.queue_position, i + 1);
    ids.push_back(submitted.record.status.id);
  }
  ASSERT_TRUE(store_->cancel(Caller::daemon(), ids[6]));
  ASSERT_TRUE(store_->claim("cpu"));
  const std::vector<int64_t> expected = {0, 1, 2, 3, 4, 5, 0, 6, 7};
  for (size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(store_->get(Caller::daemon(), ids[i])->status.queue_position, expected[i]) << i;
  }
}

}  // namespace
}  // namespace voxeld
