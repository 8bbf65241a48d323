// The facade over the parts of the gateway that JobService names. Its calls are in job_service.cpp,
// its start and end in service_start.cpp.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <semaphore>
#include <string>
#include <utility>
#include <vector>

#include "server/base/disk/file.h"
#include "server/jobs/auth/key_memory.h"
#include "server/jobs/database/database.h"
#include "server/jobs/estimates/queue_forecast.h"
#include "server/jobs/events/job_board.h"
#include "server/jobs/events/job_metrics.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/frame_store.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/records/quota.h"
#include "server/jobs/records/result_store.h"
#include "server/jobs/retention/retention.h"
#include "server/jobs/retention/store_identity.h"
#include "server/jobs/retention/store_sweep.h"
#include "server/jobs/scheduling/deadline_watch.h"
#include "server/jobs/scheduling/time_slices.h"
#include "server/jobs/service/job_service.h"
#include "server/jobs/service/queue_view.h"
#include "server/jobs/workers/supervisor.h"
#include "server/jobs/workers/task_server.h"

namespace voxeld {

// Its calls run on HTTP threads and on the connection threads of the task server.
class Service final : public JobService {
 public:
  Service(const JobServiceConfig& config, UniqueFd lock, BlobStore blobs, PartStore parts,
          StoreDatabase store, std::shared_ptr<prometheus::Registry> registry)
      : config_(config),
        lock_(std::move(lock)),
        blobs_(std::move(blobs)),
        mark_(std::move(store.mark)),
        clock_(config.clock, mark_->mark().kept_ms, mark_->mark().wall_ms),
        database_(std::move(store.database)),
        keys_(*database_),
        jobs_(
            *database_, [this](std::string_view id) { return blobs_.is_usable(id); },
            [this] { return clock_.now_ms(); }),
        parts_(std::move(parts)),
        assets_(*database_, blobs_),
        frames_(*database_, blobs_),
        results_(*database_),
        metrics_(std::move(registry)),
        costs_(config.data_dir / "costs"),
        forecast_(
            costs_, static_cast<int>(config.devices.size()),
            [this](const std::string& tenant) {
              return config_.weight_of ? static_cast<double>(config_.weight_of(tenant)) : 1.0;
            },
            [this](JobStatus& status) { board_.overlay(status); }),
        slices_(slices_config()),
        retention_(*database_, blobs_),
        sweep_(config_.storage, retention_, assets_, blobs_, metrics_, clock_,
               [this] { note_each_second(); }) {}
  ~Service() override;

  Status start();

  Result<BlobWriter> begin_upload(int64_t bytes_max, Durability durability) override {
    VOXELD_TRY(sweep_.room());
    return blobs_.begin(bytes_max, durability);
  }
  Result<int64_t> upload_room(const Caller& caller, int64_t asked) override;
  TenantLimits limits(const Caller& caller) override {
    return config_.limits_of ? config_.limits_of(caller.tenant()) : TenantLimits{};
  }
  Result<TenantUsage> usage(const Caller& caller) override;
  Result<Asset> put_asset(const Caller& caller, const BlobInfo& blob, std::string filename,
                          std::string content_type, Durability durability) override {
    return assets_.put(caller, blob, filename, content_type, stored_limits(caller.tenant()).bytes,
                       durability);
  }
  Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, std::string filename,
                           const std::vector<BundleFile>& files, Durability durability) override {
    return assets_.put_bundle(caller, blob, filename, files, stored_limits(caller.tenant()).bytes,
                              durability);
  }
  Result<Asset> get_asset(const Caller& caller, std::string_view id) override {
    return assets_.get(caller, id);
  }
  Status list_assets(const Caller& caller, const AssetCursor& after,
                     const std::function<bool(const Asset&)>& take) override {
    return assets_.list(caller, after, take);
  }
  Status delete_asset(const Caller& caller, std::string_view id) override;

  Result<JobStatus> submit(const Caller& caller, const JobRequest& request,
                           const SubmitOptions& options) override;
  Result<JobStatus> estimate(const Caller& caller, const JobRequest& request) override;
  Result<JobStatus> get(const Caller& caller, std::string_view id) override;
  Result<JobStatus> get_whole(const Caller& caller, std::string_view id) override;
  Status list(const Caller& caller, const JobQuery& query,
              const std::function<bool(const ListedJob&)>& take) override;
  std::unique_ptr<JobWatch> watch(std::string_view id, JobChange change,
                                  std::shared_ptr<Waker> waker) override {
    return board_.watch(id, change, std::move(waker));
  }
  Result<std::vector<JobEvent>> events(const Caller& caller, std::string_view id,
                                       int64_t after_id) override;
  Result<JobStatus> cancel(const Caller& caller, std::string_view id) override;
  Status forget(const Caller& caller, std::string_view id) override;
  Result<JobAndResult> get_with_result(const Caller& caller, std::string_view id) override;
  Result<StoredBlob> result_of(const JobStatus& status) override;

  Result<StoredBlob> get_grid(const Caller& caller, std::string_view id) override;
  Result<std::vector<KeptResult>> list_kept(const Caller& caller, KeptKind kind, int limit,
                                            int64_t before_seq) override {
    return results_.list(caller, kind, limit, before_seq);
  }
  Status delete_result(const Caller& caller, std::string_view job) override {
    return let_go(results_.delete_of_job(caller, job));
  }
  Status delete_grid(const Caller& caller, std::string_view id) override {
    return let_go(results_.delete_grid(caller, id));
  }
  Status delete_sequence(const Caller& caller, std::string_view id) override {
    return let_go(results_.delete_sequence(caller, id));
  }
  Result<std::optional<TileFile>> tiles_of(const JobStatus& status, int64_t tile) override;
  Result<JobFrames> frames(const Caller& caller, std::string_view job,
                           const FrameRange& range) override;
  Result<SequenceManifest> get_sequence(const Caller& caller, std::string_view id) override {
    return frames_.read(caller, id);
  }
  Result<QueueView> queue(const Caller& caller) override;
  std::vector<WorkerState> workers() override;
  int64_t queued_jobs() override;
  Status ready() override;
  bool is_disk_short() override { return !blobs_.disk().for_jobs(); }
  void drain() override { draining_ = true; }
  void stop() override;

 private:
  // Rows with all their texts that are read at a time, each of which may take megabytes.
  using WholeReads = std::counting_semaphore<4>;

  void job_submitted(const JobRecord& record, const SubmitOptions& options) noexcept;
  void forecast(JobRecord record);
  void job_changed(const JobRecord& record) noexcept;
  void job_ended(const JobRecord& record) noexcept;
  void update_gauges();
  // The asset with its files, the grid or the sequence.
  JobInput job_input(const std::string& tenant, const std::string& asset, const std::string& grid,
                     const std::string& sequence);
  void forecast_waiting();
  TimeSlicesConfig slices_config();
  // Adds what the database does not know to a status.
  void overlay(JobStatus& status);
  TaskServerConfig server_config();
  void start_supervisor();
  int supervised_workers() const;
  void keep_reserve();
  void note_each_second();
  void sync_soon();
  Result<StoredBlob> stored(std::string_view id, std::string_view what);
  Result<StoredBlob> result_file(const JobStatus& status);
  // The sweep looks at these blobs, and removes those that nothing needs.
  Status let_go(const Result<ResultStore::Ids>& ids);
  void verify_reusable(const Caller& caller, const JobRequest& request);
  QueueLimits queue_limits(const Caller& caller);
  // The tenant's limits for what is stored: without the bytes that its downloads keep.
  TenantLimits stored_limits(std::string_view tenant) const;

  const JobServiceConfig config_;
  const UniqueFd lock_;
  BlobStore blobs_;
  std::unique_ptr<StoreMarkFile> mark_;
  KeptClock clock_;
  int64_t clock_noted_ms_ = 0;  // of the sweep's thread
  std::unique_ptr<Database> database_;
  KeyMemory keys_;
  JobStore jobs_;
  PartStore parts_;
  AssetStore assets_;
  FrameStore frames_;
  ResultStore results_;
  JobBoard board_;
  JobMetrics metrics_;
  JobCosts costs_;
  QueueForecast forecast_;
  TimeSlices slices_;
  Retention retention_;
  StoreSweep sweep_;
  WholeReads whole_reads_{WholeReads::max()};
  std::atomic<bool> draining_{false};
  // Read by connection threads, which run before the supervisor is there.
  std::atomic<Supervisor*> supervising_{nullptr};
  std::unique_ptr<TaskServer> tasks_;
  std::unique_ptr<Supervisor> supervisor_;
  std::unique_ptr<DeadlineWatch> deadlines_;  // last: its thread uses the others
};

}  // namespace voxeld
