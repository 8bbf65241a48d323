#include "server/jobs/events/job_metrics.h"

#include <gtest/gtest.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <string>

namespace voxeld {
namespace {

std::string text_of(const prometheus::Registry& registry) {
  return prometheus::TextSerializer().Serialize(registry.Collect());
}

TEST(JobMetrics, an_ended_job_counts_by_kind_and_outcome_with_its_stages) {
  auto registry = std::make_shared<prometheus::Registry>();
  JobMetrics metrics(registry);
  JobStatus status;
  status.state = JobState::kDone;
  status.timings = {{"queue", 10.0}, {"voxelize", 250.0}};
  metrics.ended(status, "lab", "llvmpipe");
  status.cached = true;
  metrics.ended(status, "lab", "llvmpipe");
  const std::string text = text_of(*registry);
  EXPECT_NE(text.find("voxeld_jobs_total{kind=\"voxelize\",outcome=\"done\",tenant=\"lab\"} 1"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("voxeld_jobs_total{kind=\"voxelize\",outcome=\"cached\",tenant=\"lab\"} 1"),
            std::string::npos);
  EXPECT_NE(text.find("voxeld_stage_seconds_count{device=\"llvmpipe\",stage=\"voxelize\"} 1"),
            std::string::npos);
  EXPECT_NE(text.find("voxeld_stage_seconds_sum{device=\"llvmpipe\",stage=\"voxelize\"} 0.25"),
            std::string::npos);
}

TEST(JobMetrics, live_jobs_waits_and_workers_are_shown) {
  auto registry = std::make_shared<prometheus::Registry>();
  JobMetrics metrics(registry);
  metrics.set_jobs(3, 1);
  metrics.add_worker_up("llvmpipe", 1);
  metrics.worker_restarted("llvmpipe");
  metrics.frame_done();
  metrics.frame_done();
  JobStatus status;
  status.attempt = 1;
  status.created_ms = 1000;
  status.started_ms = 1500;
  metrics.submitted(status);
  metrics.claimed(status);
  status.attempt = 2;
  metrics.claimed(status);  // a second attempt did not wait from its creation
  metrics.requeued(status);
  const std::string text = text_of(*registry);
  for (const char* line : {"voxeld_jobs{state=\"queued\"} 3", "voxeld_jobs{state=\"running\"} 1",
                           "voxeld_frames_done_total 2", "voxeld_worker_up{device=\"llvmpipe\"} 1",
                           "voxeld_worker_restarts_total{device=\"llvmpipe\"} 1",
                           "voxeld_jobs_submitted_total{kind=\"voxelize\"} 1",
                           "voxeld_jobs_requeued_total{kind=\"voxelize\"} 1",
                           "voxeld_job_queue_seconds_count{kind=\"voxelize\"} 1",
                           "voxeld_job_queue_seconds_sum{kind=\"voxelize\"} 0.5"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  }
}

TEST(JobMetrics, counters_that_alerts_watch_begin_at_0) {
  auto registry = std::make_shared<prometheus::Registry>();
  JobMetrics metrics(registry);
  metrics.add_worker_up("cpu", 1);
  metrics.submitted({});
  metrics.ended({}, "lab", "cpu");
  const std::string text = text_of(*registry);
  for (const char* line : {"voxeld_worker_restarts_total{device=\"cpu\"} 0",
                           "voxeld_worker_replacements_total{device=\"cpu\"} 0",
                           "voxeld_fresh_worker_wait_seconds_total{device=\"cpu\"} 0",
                           "voxeld_jobs_requeued_total{kind=\"voxelize\"} 0",
                           "voxeld_jobs_preempted_total{kind=\"voxelize\",tenant=\"lab\"} 0",
                           "voxeld_evictions_total{reason=\"size\"} 0"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  }
}

TEST(JobMetrics, after_200_tenants_there_are_no_more_labels) {
  auto registry = std::make_shared<prometheus::Registry>();
  JobMetrics metrics(registry);
  for (int i = 0; i < 202; ++i) {
    const std::string tenant = "t" + std::to_string(i);
    metrics.waited(tenant, 1);
    metrics.had_slice("cpu", tenant, 1);
    metrics.used_cpu(tenant, 1);
  }
  const std::string text = text_of(*registry);
  for (const char* line : {"voxeld_queue_wait_seconds_count{tenant=\"(other)\"} 2",
                           "voxeld_device_seconds_total{device=\"cpu\",tenant=\"(other)\"} 2",
                           "voxeld_cpu_seconds_total{tenant=\"(other)\"} 2"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line;
  }
  EXPECT_EQ(text.find("\"t200\""), std::string::npos);
}

TEST(JobMetrics, disk_shows_free_total_and_reserve) {
  auto registry = std::make_shared<prometheus::Registry>();
  JobMetrics metrics(registry);
  metrics.set_disk(5000, 20000, 1000);
  const std::string text = text_of(*registry);
  for (const char* line :
       {"voxeld_disk_bytes{what=\"free\"} 5000", "voxeld_disk_bytes{what=\"total\"} 20000",
        "voxeld_disk_bytes{what=\"reserve\"} 1000"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  }
}

TEST(JobMetrics, without_a_registry_nothing_happens) {
  JobMetrics metrics(nullptr);
  metrics.ended({}, "", "");
  metrics.set_jobs(1, 1);
}

}  // namespace
}  // namespace voxeld
