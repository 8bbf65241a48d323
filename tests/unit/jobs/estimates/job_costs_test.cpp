// The cost of jobs, learned and saved, and the expected times of queued ones.
#include "server/jobs/estimates/job_costs.h"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <string>

#include "server/jobs/estimates/queue_forecast.h"
#include "tests/unit/base/heap_bytes.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

RequestOptions options(int size, Format format = Format::kNative) {
  RequestOptions options;
  options.voxelize.placement.size = size;
  options.output.format = format;
  return options;
}

const JobInput kInput{JobInput::Form::kBinary, 1 << 20};

JobWork work(int size, Format format = Format::kNative) {
  return work_of(JobKind::kVoxelize, options(size, format), kInput);
}

// Took 10 ms in the queue, and of 400 ms of work 100 on the device, for which it waited 200.
JobStatus done_job() {
  JobStatus status;
  status.id = "j-1";
  status.state = JobState::kDone;
  status.timings = {
      {"queue", 10}, {"upload", 5}, {"parse", 100}, {"voxelize", 300}, {"store", 200}};
  status.device_ms = 100;
  status.result = JobResult{};
  status.result->bytes = 5000;
  status.result->meta_json = R"({"host_bytes_peak": 123456789})";
  return status;
}

class JobCostsTest : public ::testing::Test {
 protected:
  std::filesystem::path file() const { return dir_.path() / "costs"; }
  testing::TemporaryDir dir_;
};

TEST_F(JobCostsTest, waits_are_no_work) {
  const MeasuredSeconds seconds = measured_seconds(done_job());
  EXPECT_DOUBLE_EQ(seconds.device, 0.1);
  EXPECT_DOUBLE_EQ(seconds.worker, 0.4);
  EXPECT_DOUBLE_EQ(seconds.read, 0.1);
}

TEST_F(JobCostsTest, jobs_of_each_format_are_a_sort_of_their_own) {
  for (const FormatInfo& format : output_formats()) {
    EXPECT_EQ(work(64, format.format).sort,
              "voxelize " + std::string(format.name) + " surface attributes");
  }
}

TEST_F(JobCostsTest, images_cost_by_their_rays) {
  RequestOptions options;
  options.render.width = options.render.height = 1000;
  options.render.samples = 1;
  const JobWork one = work_of(JobKind::kRender, options, kInput);
  options.render.samples = 4;
  options.render.turntable = 360;
  const JobWork many = work_of(JobKind::kRender, options, kInput);
  EXPECT_DOUBLE_EQ(many.features.side, 4 * one.features.side);
  EXPECT_DOUBLE_EQ(many.frames, 360 * one.frames);
}

TEST_F(JobCostsTest, jobs_cost_by_the_frames_that_they_make) {
  const JobInput sequence{JobInput::Form::kGrid, 1000, 24};
  RequestOptions options;
  EXPECT_EQ(work_of(JobKind::kExport, options, sequence).frames, 24);
  EXPECT_EQ(work_of(JobKind::kRender, options, sequence).frames, 1) << "a PNG is of one frame";
  options.render.image = ImageKind::kGif;
  EXPECT_EQ(work_of(JobKind::kRender, options, sequence).frames, 24);
  options.animation.frames = std::array{3, 5};
  EXPECT_EQ(work_of(JobKind::kExport, options, sequence).frames, 3);
  EXPECT_EQ(work_of(JobKind::kRender, options, sequence).frames, 3);
  EXPECT_EQ(work_of(JobKind::kRender, options, kInput).frames, 3);
  options.render.image = ImageKind::kPng;
  EXPECT_EQ(work_of(JobKind::kRender, options, kInput).frames, 1);
}

TEST_F(JobCostsTest, solids_cost_by_their_sign) {
  RequestOptions solid = options(256);
  solid.voxelize.fill = Fill::kSolid;
  const JobWork plain = work_of(JobKind::kVoxelize, solid, kInput);
  solid.voxelize.sign = Sign::kWinding;
  const JobWork winding = work_of(JobKind::kVoxelize, solid, kInput);
  EXPECT_NE(winding.sort, plain.sort);
  EXPECT_GT(winding.guess.device_seconds, 4 * plain.guess.device_seconds);
}

TEST_F(JobCostsTest, a_job_that_was_cancelled_late_is_expected_to_take_long) {
  JobCosts costs(file());
  const double guess = costs.estimate(work(256)).device_seconds;
  costs.learn_at_least(work(256), guess / 2);
  EXPECT_DOUBLE_EQ(costs.estimate(work(256)).device_seconds, guess);
  costs.learn_at_least(work(256), 1000 * guess);
  const JobEstimate learned = costs.estimate(work(256));
  EXPECT_GT(learned.device_seconds, 100 * guess);
  EXPECT_GE(learned.seconds, learned.device_seconds);
}

TEST_F(JobCostsTest, jobs_of_other_sorts_teach_nothing) {
  JobCosts costs(file());
  for (int i = 0; i < 200; ++i) costs.learn(work(256), done_job());
  const JobEstimate known = costs.estimate(work(256));
  EXPECT_EQ(known.learned_from, 200);
  EXPECT_NEAR(known.seconds, 0.4, 0.01);
  EXPECT_NEAR(known.device_seconds, 0.1, 0.005);
  EXPECT_NEAR(static_cast<double>(known.result_bytes), 5000, 100);
  EXPECT_NEAR(static_cast<double>(known.host_bytes), 123456789, 2e6);
  EXPECT_LT(known.seconds_high / known.seconds_low, 1.6);
  EXPECT_EQ(costs.estimate(work(256, Format::kNpy)).learned_from, 0);
  RequestOptions solid = options(256);
  solid.voxelize.fill = Fill::kSolid;
  EXPECT_EQ(costs.estimate(work_of(JobKind::kVoxelize, solid, kInput)).learned_from, 0);
}

TEST_F(JobCostsTest, learned_costs_outlive_the_process) {
  std::string before;
  {
    JobCosts costs(file());
    costs.learn(work(256), done_job());
    before = std::to_string(costs.estimate(work(700)).seconds);
  }
  JobCosts costs(file());
  EXPECT_EQ(costs.estimate(work(256)).learned_from, 1);
  EXPECT_EQ(std::to_string(costs.estimate(work(700)).seconds), before);
}

TEST_F(JobCostsTest, a_broken_file_costs_its_broken_lines) {
  {
    JobCosts costs(file());
    costs.learn(work(256), done_job());
  }
  std::ofstream(file(), std::ios::app) << "nonsense\nvoxelize\tseconds\t1 2 3\n\tx\t\n";
  EXPECT_EQ(JobCosts(file()).estimate(work(256)).learned_from, 1);
  std::ofstream(file(), std::ios::trunc) << std::string(1000, '\t') << '\0';
  EXPECT_EQ(JobCosts(file()).estimate(work(256)).learned_from, 0);
}

JobRecord record(const std::string& id, const std::string& tenant, int64_t seq) {
  JobRecord record;
  record.status.id = id;
  record.status.options_json = R"({"size":256})";
  record.status.asset = "sha256-1";
  record.tenant = tenant;
  record.seq = seq;
  return record;
}

TEST_F(JobCostsTest, jobs_are_expected_in_their_order_and_by_their_weights) {
  JobCosts costs(file());
  const auto weight = [](const std::string& tenant) { return tenant == "heavy" ? 9.0 : 1.0; };
  QueueForecast queue(costs, 1, weight, [](JobStatus&) {});
  JobRecord urgent = record("urgent", "light", 3);
  urgent.status.priority = 5;
  queue.add(record("first", "light", 1), kInput);
  queue.add(record("second", "light", 2), kInput);
  queue.add(urgent, kInput);
  queue.add(record("heavy", "heavy", 4), kInput);
  const auto end_of = [&](const char* id) {
    JobStatus status;
    status.id = id;
    queue.fill(status);
    EXPECT_TRUE(status.estimate);
    EXPECT_LE(status.expected_start_ms, status.expected_end_ms);
    return status.expected_end_ms;
  };
  // Times are from now on, so a pause of the machine between two of them moves the later ones on.
  const int64_t heavy_end = end_of("heavy"), urgent_end = end_of("urgent");
  const int64_t first_end = end_of("first"), second_end = end_of("second");
  EXPECT_LT(heavy_end, urgent_end);
  EXPECT_LT(urgent_end, first_end);
  EXPECT_LT(first_end, second_end);
  JobRequest request;
  request.asset = "sha256-1";
  request.options = options(256);
  const JobStatus estimated = queue.estimate("light", request, kInput);
  EXPECT_EQ(estimated.queue_position, 5);
  EXPECT_GE(estimated.expected_start_ms, second_end - 1000);
}

TEST_F(JobCostsTest, options_of_jobs_that_wait_are_not_kept) {
  constexpr int kJobs = 100, kBytes = 100'000;
  JobCosts costs(file());
  QueueForecast queue(
      costs, 1, [](const std::string&) { return 1.0; }, [](JobStatus&) {});
  const int64_t before = testing::heap_bytes();
  for (int i = 0; i < kJobs; ++i) {
    JobRecord waiting = record("j-" + std::to_string(i), "", i);
    waiting.status.options_json.append(kBytes, ' ');
    queue.add(waiting, kInput);
  }
  EXPECT_LT(testing::heap_bytes() - before, kJobs * kBytes / 4);
}

TEST_F(JobCostsTest, a_running_job_tells_how_far_it_is_beyond_its_estimate) {
  JobCosts costs(file());
  QueueForecast queue(
      costs, 1, [](const std::string&) { return 1.0; }, [](JobStatus&) {});
  queue.add(record("j-1", "", 1), kInput);
  JobStatus status;
  status.id = "j-1";
  queue.fill(status);
  ASSERT_TRUE(status.estimate);
  EXPECT_EQ(status.estimate->overrun, 0);
  const double expected_ms = status.estimate->device_seconds * 1000;
  status.state = JobState::kRunning;
  status.device_ms = expected_ms;
  queue.fill(status);
  EXPECT_EQ(status.estimate->overrun, 0);
  status.device_ms = 100 * expected_ms;
  queue.fill(status);
  EXPECT_NEAR(status.estimate->overrun, 100, 1e-6);
}

TEST_F(JobCostsTest, a_change_that_is_told_late_is_left_out) {
  JobCosts costs(file());
  QueueForecast queue(
      costs, 1, [](const std::string&) { return 1.0; }, [](JobStatus&) {});
  JobRecord waiting = record("j-1", "", 1);
  queue.add(waiting, kInput);
  const double expected = queue.expected_seconds("j-1");
  JobRecord running = waiting;
  running.status.state = JobState::kRunning;  // since 1970
  running.status.version = waiting.status.version + 1;
  queue.changed(running);
  EXPECT_GT(queue.expected_seconds("j-1"), 2 * expected) << "it is late";
  queue.changed(waiting);
  EXPECT_GT(queue.expected_seconds("j-1"), 2 * expected);
}

TEST_F(JobCostsTest, jobs_that_end_teach_and_are_expected_no_more) {
  JobCosts costs(file());
  QueueForecast queue(
      costs, 1, [](const std::string&) { return 1.0; }, [](JobStatus&) {});
  queue.add(record("j-1", "", 1), kInput);
  JobRecord ended = record("j-1", "", 1);
  ended.status = done_job();
  queue.changed(ended);
  EXPECT_EQ(costs.estimate(work(256)).learned_from, 1);
  JobStatus status;
  status.id = "j-1";
  queue.fill(status);
  EXPECT_FALSE(status.estimate);
  queue.changed(record("j-1", "", 1));  // told by a thread that was late
  queue.fill(status);
  EXPECT_FALSE(status.estimate);
  // It took another job's result, so its times say nothing about the cost of such work.
  queue.add(record("j-2", "", 2), kInput);
  ended.status.id = "j-2";
  ended.status.cached = true;
  queue.changed(ended);
  EXPECT_EQ(costs.estimate(work(256)).learned_from, 1);
}

}  // namespace
}  // namespace voxeld
