// The service with workers that the tests themselves play over the socket.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "server/base/clock.h"
#include "server/jobs/database/sqlite_connection.h"
#include "server/jobs/service/job_service.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/fake_worker.h"
#include "tests/unit/jobs/wait_job.h"

namespace voxeld::testing {

class ServiceTest : public ::testing::Test {
 protected:
  using Clock = JobService::Clock;

  void SetUp() override { start(); }
  // As a new process would.
  void start() {
    service_.reset();
    JobServiceConfig config;
    config.data_dir = dir_.path() / "data";
    config.start_workers = false;
    config.limits_of = [this](std::string_view) { return limits_; };
    config.limits = task_limits_;
    config.queued_jobs_max = queued_jobs_max_;
    config.memory_bytes_max = memory_bytes_max_;
    config.is_queue_shared = [this] { return is_queue_shared_; };
    config.store_match = store_match_;
    config.isolation = [this] { return isolation_.load(); };
    config.clock = {
        [this] { return unix_time_ms() + wall_jump_ms_; },
        [steady_ms = KeptClock::real().steady_ms, this] { return steady_ms() + passed_ms_; }};
    auto service = start_job_service(config, nullptr);
    ASSERT_TRUE(service) << service.error().message();
    service_ = *std::move(service);
  }
  FakeWorker connect() { return {dir_.path() / "data/run/tasks.sock", "llvmpipe", kPatience}; }
  // As it is on the disk.
  BlobStore blobs() { return BlobStore::open(dir_.path() / "data").value(); }
  // Deleted blobs go on a thread of the service.
  bool is_removed(const std::string& id) {
    return comes_true([&] { return !blobs().stat(id); });
  }
  BlobInfo put_blob(const std::string& text) {
    auto writer = service_->begin_upload(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return writer->finish().value();
  }
  std::string put_asset(const std::string& text, const std::string& filename = "bob.md5mesh") {
    return service_->put_asset(Caller::open(), put_blob(text), filename, "").value().id;
  }
  JobStatus submit(const JobRequest& request) {
    auto status = service_->submit(Caller::open(), request, {});
    EXPECT_TRUE(status) << status.error().message();
    return status ? *status : JobStatus{};
  }
  // A request for animation 0 of an asset.
  JobRequest moving(const std::string& text = "mesh") {
    JobRequest request;
    request.asset = put_asset(text);
    request.options.animation.animation = "0";
    return request;
  }
  // Bytes of the tenant's blobs: its usage without rows.
  int64_t blob_bytes(const Caller& caller) {
    auto reader =
        SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kReader);
    EXPECT_TRUE(reader);
    auto sum = reader->query("SELECT SUM(bytes) FROM holdings WHERE tenant = $1", caller.tenant());
    EXPECT_TRUE(sum && sum->step());
    return sum->int64(0);
  }
  JobStatus wait_end(const std::string& id) {
    return testing::wait_end(*service_, Caller::open(), id).value();
  }

  TemporaryDir dir_;
  TenantLimits limits_;  // of every tenant
  TaskLimits task_limits_;
  int queued_jobs_max_ = limits::kQueuedJobsMax;
  int64_t memory_bytes_max_ = 0;
  bool is_queue_shared_ = false;
  StoreMatch store_match_ = StoreMatch::kRequired;
  std::atomic<WorkerIsolation> isolation_{WorkerIsolation::kNone};
  std::atomic<int64_t> wall_jump_ms_{0};  // of the system's clock
  std::atomic<int64_t> passed_ms_{0};     // beside the time that passes
  std::unique_ptr<JobService> service_;
};

}  // namespace voxeld::testing
