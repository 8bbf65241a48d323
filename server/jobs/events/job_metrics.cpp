#include "server/jobs/events/job_metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <utility>

#include "proto/version.h"
#include "server/base/algorithm_version.h"
#include "server/jobs/model/tenant_labels.h"

namespace voxeld {
namespace {

using prometheus::BuildCounter;
using prometheus::BuildGauge;
using prometheus::BuildHistogram;
using prometheus::Counter;
using prometheus::Family;
using prometheus::Gauge;
using prometheus::Histogram;

// Seconds: from a small mesh on a GPU to a large one in software.
prometheus::Histogram::BucketBoundaries seconds_buckets() {
  return {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300};
}

std::string kind_of(const JobStatus& status) {
  return std::string(job_kind_name(status.kind));
}

}  // namespace

struct JobMetrics::Impl {
  explicit Impl(std::shared_ptr<prometheus::Registry> shared)
      : registry(std::move(shared)),
        jobs(BuildGauge().Name("voxeld_jobs").Help("Live jobs by state.").Register(*registry)),
        submitted(BuildCounter()
                      .Name("voxeld_jobs_submitted_total")
                      .Help("Jobs that were accepted, by kind.")
                      .Register(*registry)),
        ended(BuildCounter()
                  .Name("voxeld_jobs_total")
                  .Help("Jobs that ended, by tenant, kind and outcome: done, cached, failed, "
                        "cancelled.")
                  .Register(*registry)),
        requeued(BuildCounter()
                     .Name("voxeld_jobs_requeued_total")
                     .Help("Jobs that were put back because their worker went away, by kind.")
                     .Register(*registry)),
        preempted(
            BuildCounter()
                .Name("voxeld_jobs_preempted_total")
                .Help("Times that a started job gave its worker to another one, by tenant and "
                      "kind.")
                .Register(*registry)),
        queue_seconds(BuildHistogram()
                          .Name("voxeld_job_queue_seconds")
                          .Help("Time from acceptance to the start of the first attempt, by kind.")
                          .Register(*registry)),
        stage_seconds(BuildHistogram()
                          .Name("voxeld_stage_seconds")
                          .Help("Time of each stage of finished jobs, by stage and device.")
                          .Register(*registry)),
        frames_done(BuildCounter()
                        .Name("voxeld_frames_done_total")
                        .Help("Frames of sequences that workers have made.")
                        .Register(*registry)
                        .Add({})),
        restarts(BuildCounter()
                     .Name("voxeld_worker_restarts_total")
                     .Help("Worker processes that ended and were started again, by device.")
                     .Register(*registry)),
        replacements(BuildCounter()
                         .Name("voxeld_worker_replacements_total")
                         .Help("Workers that gave way to fresh ones for other tenants, by device.")
                         .Register(*registry)),
        fresh_wait_seconds(
            BuildCounter()
                .Name("voxeld_fresh_worker_wait_seconds_total")
                .Help("Seconds in which the next job waited for a fresh worker, by device.")
                .Register(*registry)),
        worker_up(BuildGauge()
                      .Name("voxeld_worker_up")
                      .Help("Worker processes that are connected, by device.")
                      .Register(*registry)),
        device_seconds(BuildCounter()
                           .Name("voxeld_device_seconds_total")
                           .Help("Time for which tasks have had a device, by device and tenant.")
                           .Register(*registry)),
        cpu_seconds(
            BuildCounter()
                .Name("voxeld_cpu_seconds_total")
                .Help("CPU time of workers on tasks outside of time slices on a device (reading, "
                      "encoding, exports), by tenant.")
                .Register(*registry)),
        queue_wait(BuildHistogram()
                       .Name("voxeld_queue_wait_seconds")
                       .Help("Time from acceptance to the first start, by tenant.")
                       .Register(*registry)),
        slice_seconds(
            BuildHistogram()
                .Name("voxeld_time_slice_seconds")
                .Help("Length of time slices on a device, which end between tiles, by device.")
                .Register(*registry)),
        store_bytes(BuildGauge()
                        .Name("voxeld_store_bytes")
                        .Help("Bytes of all files of assets, results, grids and frames.")
                        .Register(*registry)
                        .Add({})),
        damaged(BuildGauge()
                    .Name("voxeld_store_damaged_blobs")
                    .Help("Files whose bytes did not match their name, since the start.")
                    .Register(*registry)
                    .Add({})),
        disk(BuildGauge()
                 .Name("voxeld_disk_bytes")
                 .Help("Disk of the data directory: free, total, and reserve, below which uploads "
                       "and results are refused.")
                 .Register(*registry)),
        evictions(BuildCounter()
                      .Name("voxeld_evictions_total")
                      .Help("Results and assets that went by size or age, by reason.")
                      .Register(*registry)),
        worker_memory(BuildGauge()
                          .Name("voxeld_worker_memory_bytes")
                          .Help("Memory that a device's worker processes take, without what they "
                                "have mapped of files.")
                          .Register(*registry)),
        device_memory(BuildGauge()
                          .Name("voxeld_gpu_memory_bytes")
                          .Help("Memory of a GPU as its driver tells: total and free.")
                          .Register(*registry)),
        device_degraded(BuildGauge()
                            .Name("voxeld_device_degraded")
                            .Help("1 while the CPU goes on in place of a device that failed in "
                                  "its last job.")
                            .Register(*registry)) {
    BuildGauge()
        .Name("voxeld_build_info")
        .Help("1, with the version as a label.")
        .Register(*registry)
        .Add(
            {{"version", std::string(version())}, {"algorithm", std::to_string(kAlgorithmVersion)}})
        .Set(1);
    for (const char* reason : {"size", "age", "asset-age"}) evictions.Add({{"reason", reason}});
  }

  std::shared_ptr<prometheus::Registry> registry;
  Family<Gauge>& jobs;
  Family<Counter>& submitted;
  Family<Counter>& ended;
  Family<Counter>& requeued;
  Family<Counter>& preempted;
  Family<Histogram>& queue_seconds;
  Family<Histogram>& stage_seconds;
  Counter& frames_done;
  Family<Counter>& restarts;
  Family<Counter>&replacements, &fresh_wait_seconds;
  Family<Gauge>& worker_up;
  Family<Counter>& device_seconds;
  Family<Counter>& cpu_seconds;
  Family<Histogram>& queue_wait;
  Family<Histogram>& slice_seconds;
  Gauge& store_bytes;
  Gauge& damaged;
  Family<Gauge>& disk;
  Family<Counter>& evictions;
  Family<Gauge>& worker_memory;
  Family<Gauge>& device_memory;
  Family<Gauge>& device_degraded;

  TenantLabels tenants;
};

JobMetrics::JobMetrics(std::shared_ptr<prometheus::Registry> registry) {
  if (registry != nullptr) impl_ = std::make_unique<Impl>(std::move(registry));
}
JobMetrics::~JobMetrics() = default;

void JobMetrics::submitted(const JobStatus& status) {
  if (!impl_) return;
  impl_->submitted.Add({{"kind", kind_of(status)}}).Increment();
  impl_->requeued.Add({{"kind", kind_of(status)}});  // from 0: a rate needs two samples
}

void JobMetrics::claimed(const JobStatus& status) {
  if (!impl_ || status.attempt != 1 || status.preempted > 0) return;
  impl_->queue_seconds.Add({{"kind", kind_of(status)}}, seconds_buckets())
      .Observe(static_cast<double>(status.started_ms - status.created_ms) / 1000.0);
}

void JobMetrics::waited(const std::string& tenant, double seconds) {
  if (!impl_) return;
  impl_->queue_wait.Add({{"tenant", impl_->tenants.of(tenant)}}, seconds_buckets())
      .Observe(seconds);
}

void JobMetrics::had_slice(const std::string& device, const std::string& tenant, double seconds) {
  if (!impl_) return;
  impl_->device_seconds.Add({{"device", device}, {"tenant", impl_->tenants.of(tenant)}})
      .Increment(seconds);
  impl_->slice_seconds.Add({{"device", device}}, seconds_buckets()).Observe(seconds);
}

void JobMetrics::used_cpu(const std::string& tenant, double seconds) {
  if (!impl_) return;
  impl_->cpu_seconds.Add({{"tenant", impl_->tenants.of(tenant)}}).Increment(seconds);
}

void JobMetrics::requeued(const JobStatus& status) {
  if (impl_) impl_->requeued.Add({{"kind", kind_of(status)}}).Increment();
}

void JobMetrics::preempted(const JobStatus& status, const std::string& tenant) {
  if (!impl_) return;
  impl_->preempted.Add({{"tenant", impl_->tenants.of(tenant)}, {"kind", kind_of(status)}})
      .Increment();
}

void JobMetrics::ended(const JobStatus& status, const std::string& tenant,
                       const std::string& device) {
  if (!impl_) return;
  const std::string outcome = status.cached ? "cached" : std::string(job_state_name(status.state));
  const std::string label = impl_->tenants.of(tenant);
  impl_->ended.Add({{"tenant", label}, {"kind", kind_of(status)}, {"outcome", outcome}})
      .Increment();
  impl_->preempted.Add({{"tenant", label}, {"kind", kind_of(status)}});  // as with requeued
  if (status.cached) return;
  for (const auto& [stage, ms] : status.timings) {
    if (stage == "queue") continue;
    impl_->stage_seconds.Add({{"stage", stage}, {"device", device}}, seconds_buckets())
        .Observe(ms / 1000.0);
  }
}

void JobMetrics::frame_done() {
  if (impl_) impl_->frames_done.Increment();
}

void JobMetrics::set_jobs(int64_t queued, int64_t running) {
  if (!impl_) return;
  impl_->jobs.Add({{"state", "queued"}}).Set(static_cast<double>(queued));
  impl_->jobs.Add({{"state", "running"}}).Set(static_cast<double>(running));
}

void JobMetrics::worker_restarted(const std::string& device) {
  if (impl_) impl_->restarts.Add({{"device", device}}).Increment();
}

void JobMetrics::worker_replaced(const std::string& device) {
  if (impl_) impl_->replacements.Add({{"device", device}}).Increment();
}

void JobMetrics::waited_for_fresh_worker(const std::string& device, double seconds) {
  if (impl_) impl_->fresh_wait_seconds.Add({{"device", device}}).Increment(seconds);
}

void JobMetrics::add_worker_up(const std::string& device, int workers) {
  if (!impl_) return;
  impl_->worker_up.Add({{"device", device}}).Increment(workers);
  for (auto* counters : {&impl_->restarts, &impl_->replacements, &impl_->fresh_wait_seconds}) {
    counters->Add({{"device", device}});
  }
  impl_->device_degraded.Add({{"device", device}});
}

void JobMetrics::set_store(int64_t bytes, int64_t damaged) {
  if (!impl_) return;
  impl_->store_bytes.Set(static_cast<double>(bytes));
  impl_->damaged.Set(static_cast<double>(damaged));
}

void JobMetrics::set_disk(int64_t free_bytes, int64_t total_bytes, int64_t reserve_bytes) {
  if (!impl_) return;
  impl_->disk.Add({{"what", "free"}}).Set(static_cast<double>(free_bytes));
  impl_->disk.Add({{"what", "total"}}).Set(static_cast<double>(total_bytes));
  impl_->disk.Add({{"what", "reserve"}}).Set(static_cast<double>(reserve_bytes));
}

void JobMetrics::evicted(const std::string& reason, int64_t count) {
  if (!impl_) return;
  impl_->evictions.Add({{"reason", reason}}).Increment(static_cast<double>(count));
}

void JobMetrics::set_worker_memory(const std::string& device, int64_t bytes) {
  if (impl_) impl_->worker_memory.Add({{"device", device}}).Set(static_cast<double>(bytes));
}

void JobMetrics::set_device_memory(const std::string& device, int64_t bytes_total,
                                   int64_t bytes_free) {
  if (!impl_) return;
  const auto set = [&](const char* what, int64_t bytes) {
    impl_->device_memory.Add({{"device", device}, {"what", what}}).Set(static_cast<double>(bytes));
  };
  set("total", bytes_total);
  set("free", bytes_free);
}

void JobMetrics::set_degraded(const std::string& device, bool is_degraded) {
  if (impl_) impl_->device_degraded.Add({{"device", device}}).Set(is_degraded ? 1 : 0);
}

}  // namespace voxeld
