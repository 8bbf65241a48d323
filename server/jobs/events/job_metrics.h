// Metrics of jobs and workers. Only job_metrics.cpp includes prometheus-cpp's classes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "proto/messages/job.h"

namespace prometheus {
class Registry;
}

namespace voxeld {

// Thread-safe. Without a registry every call does nothing.
class JobMetrics {
 public:
  explicit JobMetrics(std::shared_ptr<prometheus::Registry> registry);
  ~JobMetrics();

  void submitted(const JobStatus& status);
  // A worker took it: observes how long it waited.
  void claimed(const JobStatus& status);
  // Since it was queued, at its first start.
  void waited(const std::string& tenant, double seconds);
  // A task of the tenant had a time slice on the device.
  void had_slice(const std::string& device, const std::string& tenant, double seconds);
  // Its worker has computed without a time slice.
  void used_cpu(const std::string& tenant, double seconds);
  // Its worker was lost and it waits again.
  void requeued(const JobStatus& status);
  // It gave its worker to another tenant's job and waits again.
  void preempted(const JobStatus& status, const std::string& tenant);
  // Counts by tenant, kind and outcome, and observes each stage on the device that ran it.
  void ended(const JobStatus& status, const std::string& tenant, const std::string& device);
  // A frame was listed.
  void frame_done();
  void set_jobs(int64_t queued, int64_t running);
  void worker_restarted(const std::string& device);
  // A worker that had had other tenants' tasks gave way to a fresh one (worker_isolation.h).
  void worker_replaced(const std::string& device);
  // A job was next, and no fresh worker was there for so long.
  void waited_for_fresh_worker(const std::string& device, double seconds);
  // Counts the device's workers that are connected. Counters of the device begin at 0 with the
  // first call, because a rate needs two samples.
  void add_worker_up(const std::string& device, int workers);
  // Bytes of all blobs; how many were ever found damaged.
  void set_store(int64_t bytes, int64_t damaged);
  // Sets the bytes of the data directory's file system; `reserve_bytes` as DiskRoom keeps it.
  void set_disk(int64_t free_bytes, int64_t total_bytes, int64_t reserve_bytes);
  // Things that were removed unasked: "size", "age" (results), "asset-age".
  void evicted(const std::string& reason, int64_t count);
  // Memory of all workers of the device.
  void set_worker_memory(const std::string& device, int64_t bytes);
  void set_device_memory(const std::string& device, int64_t bytes_total, int64_t bytes_free);
  // Whether the CPU went on in place of the device in the last job of one of its workers.
  void set_degraded(const std::string& device, bool is_degraded);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld
