// Ages by a clock that the tests set.
#include "server/jobs/retention/store_sweep.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/retention/age_budget.h"
#include "server/jobs/retention/kept_clock.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr int64_t kHourMs = int64_t{60} * 60 * 1000, kDayMs = 24 * kHourMs, kYearMs = 365 * kDayMs;

class StoreSweepTest : public ::testing::Test {
 protected:
  void SetUp() override { start(0, 0); }
  // As a process would with what the one before saved.
  void start(int64_t saved_kept_ms, int64_t saved_wall_ms) {
    sweep_.reset();
    clock_ = std::make_unique<KeptClock>(
        KeptClock::Sources{[this] { return wall_ms_; }, [this] { return steady_ms_; }},
        saved_kept_ms, saved_wall_ms);
    StorageLimits limits;
    limits.keep_results_days = limits.keep_assets_days = limits.keep_jobs_days = 30;
    sweep_ =
        std::make_unique<StoreSweep>(limits, retention_, assets_, blobs_, metrics_, *clock_, [] {});
  }
  void pass(int64_t ms) {
    wall_ms_ += ms;
    steady_ms_ += ms;
  }
  void put_results(int number) {
    const Status put = database_->write([&](SqlConnection& connection) -> Status {
      for (int i = 0; i < number; ++i) {
        VOXELD_TRY(connection.run(
            "INSERT INTO results (request_hash, blob, bytes, media_type, filename, grid, meta_json,"
            " warnings_json, created_ms, used_ms) VALUES ('', $1, 1, '', '', '', '{}', '[]', $2, "
            "$2)",
            "b" + std::to_string(++made_), wall_ms_));
      }
      return {};
    });
    ASSERT_TRUE(put) << put.error().message();
    sweep_->look_at_ages();
  }
  void run(const std::string& sql) {
    const Status done = database_->write([&](SqlConnection& c) { return c.run(sql); });
    ASSERT_TRUE(done) << done.error().message();
  }
  // After another look.
  int64_t results() {
    sweep_->look_at_ages();
    return retention_.count(Retention::Aged::kResults).value();
  }
  testing::TemporaryDir dir_;
  int64_t wall_ms_ = 1'800'000'000'000, steady_ms_ = 5000;
  int made_ = 0;
  BlobStore blobs_ = BlobStore::open(dir_.path()).value();
  std::unique_ptr<Database> database_ = SqliteDatabase::open(dir_.path() / "jobs.sqlite").value();
  AssetStore assets_{*database_, blobs_};
  Retention retention_{*database_, blobs_};
  JobMetrics metrics_{nullptr};
  std::unique_ptr<KeptClock> clock_;
  std::unique_ptr<StoreSweep> sweep_;
};

TEST_F(StoreSweepTest, a_jump_of_the_system_clock_makes_nothing_old) {
  put_results(20);
  wall_ms_ += 10 * kYearMs;
  EXPECT_EQ(results(), 20);
  put_results(1);  // with a time in the future
  wall_ms_ -= 60 * kYearMs;
  EXPECT_EQ(results(), 21);
  put_results(1);  // with one that is decades ago
  wall_ms_ += 50 * kYearMs;
  EXPECT_EQ(results(), 22);
}

TEST_F(StoreSweepTest, a_jump_while_the_daemon_was_stopped_counts_as_a_day) {
  put_results(20);
  const int64_t kept_ms = clock_->now_ms(), saved_wall_ms = wall_ms_;
  wall_ms_ += 10 * kYearMs;
  start(kept_ms, saved_wall_ms);
  EXPECT_EQ(clock_->now_ms(), kept_ms + kDayMs);
  EXPECT_EQ(results(), 20);
  wall_ms_ -= 20 * kYearMs;
  start(kept_ms, saved_wall_ms);
  EXPECT_EQ(clock_->now_ms(), kept_ms);
}

TEST_F(StoreSweepTest, of_what_is_really_old_a_tenth_goes_within_an_hour) {
  put_results(100);
  pass(31 * kDayMs);
  EXPECT_EQ(results(), 90);
  EXPECT_EQ(results(), 90) << "the same hour";
  pass(kHourMs);
  EXPECT_EQ(results(), 81);
  pass(kHourMs);
  put_results(1000);
  EXPECT_EQ(results(), 1000) << "81 were old, and a tenth of 1081 are more";
}

TEST_F(StoreSweepTest, what_was_used_is_as_old_as_its_last_use) {
  put_results(2);
  pass(20 * kDayMs);
  run("UPDATE results SET used_ms = used_ms + 1 WHERE blob = 'b1'");
  EXPECT_EQ(results(), 2);
  pass(11 * kDayMs);
  EXPECT_EQ(results(), 1);
  pass(18 * kDayMs);
  EXPECT_EQ(results(), 1);
  pass(2 * kDayMs);
  EXPECT_EQ(results(), 0);
}

TEST_F(StoreSweepTest, assets_and_jobs_age_by_the_same_clock) {
  run("INSERT INTO assets (tenant, id, filename, content_type, bytes, created_ms, used_ms)"
      " VALUES ('', 'a', '', '', 1, 1, 1)");
  run("INSERT INTO jobs (id, kind, state, asset, grid, filename, options_json, request_hash,"
      " use_cache, transient, created_ms, ended_ms) VALUES ('j', 'voxelize', 'done', 'a', '', '',"
      " '{}', '', 1, 0, 1, 1)");
  const auto left = [&] {
    sweep_->look_at_ages();
    return retention_.count(Retention::Aged::kAssets).value() +
           retention_.count(Retention::Aged::kJobs).value();
  };
  EXPECT_EQ(left(), 2) << "they seem to be from 1970";
  wall_ms_ += kYearMs;
  EXPECT_EQ(left(), 2);
  pass(31 * kDayMs);
  EXPECT_EQ(left(), 0);
}

TEST_F(StoreSweepTest, deletions_without_a_pause_do_not_keep_the_rest_from_its_turn) {
  std::atomic<int> turns = 0;
  std::atomic<bool> ends = false;
  StoreSweep sweep({}, retention_, assets_, blobs_, metrics_, *clock_, [&] { ++turns; });
  sweep.start();
  std::thread deleting([&] {
    while (!ends) sweep.look_at_deleted();
  });
  EXPECT_TRUE(testing::comes_true([&] { return turns >= 3; }));
  ends = true;
  deleting.join();
}

TEST(KeptClockTest, a_jump_is_told_once) {
  int64_t wall_ms = 1'800'000'000'000, steady_ms = 0;
  KeptClock clock({[&] { return wall_ms; }, [&] { return steady_ms; }}, 0, 0);
  EXPECT_EQ(clock.now_ms(), wall_ms);
  wall_ms += 1000;
  steady_ms += 1500;
  EXPECT_EQ(clock.take_jump_ms(), 0);
  wall_ms -= kHourMs;
  EXPECT_EQ(clock.take_jump_ms(), -kHourMs - 500);
  EXPECT_EQ(clock.take_jump_ms(), 0);
}

TEST(AgeBudgetTest, is_a_tenth_or_four_averages_of_an_hour_or_all) {
  const auto left = [](double keep_days, int64_t there) {
    AgeBudget budget(keep_days);
    return budget.left(0, [&]() -> Result<int64_t> { return there; }).value();
  };
  EXPECT_EQ(left(30, 1000), 100);
  EXPECT_EQ(left(30, 3), 1);
  EXPECT_EQ(left(30, 0), 0);
  EXPECT_EQ(left(1, 1200), 200);  // 4 of 24 hours
  EXPECT_GT(left(1.0 / 6, 1), 1'000'000);
}

}  // namespace
}  // namespace voxeld
