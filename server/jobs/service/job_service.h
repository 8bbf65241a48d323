// The service that the HTTP API calls: assets, jobs, events, results. A facade over the job store
// (SQLite), the blob store and the task server. Thread-safe; no call waits for a job.
//
// Every call on a resource that a tenant owns names its caller (caller.h). A resource that the
// caller may not see is not-found, with the same text as an id that never existed.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/limits.h"
#include "proto/messages/bundle_manifest.h"
#include "proto/messages/job.h"
#include "proto/messages/sequence.h"
#include "proto/messages/task_api.h"
#include "proto/result.h"
#include "server/base/waker.h"
#include "server/jobs/model/assets.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/job_watch.h"
#include "server/jobs/model/results.h"
#include "server/jobs/model/store_limits.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/retention/kept_clock.h"
#include "server/jobs/scheduling/worker_isolation.h"
#include "server/store/object_store.h"

namespace prometheus {
class Registry;
}

namespace voxeld {

class JobService {
 public:
  using Clock = std::chrono::steady_clock;
  virtual ~JobService() = default;

  // --- assets
  // Begins an upload of at most `bytes_max` bytes. kSoon: for a transient job, whose client is told
  // nothing before it has ended. Errors: storage-full.
  virtual Result<BlobWriter> begin_upload(int64_t bytes_max, Durability durability) = 0;
  Result<BlobWriter> begin_upload(int64_t bytes_max) {
    return begin_upload(bytes_max, Durability::kNow);
  }
  // The bytes that an upload of the caller may have within its tenant's quota. `asked`: its length,
  // 0 if unknown. Blobs that the tenant has already cost nothing. An upload of the length of one of
  // them is therefore accepted here; put_asset() decides by its hash. Errors: quota-exceeded,
  // payload-too-large.
  virtual Result<int64_t> upload_room(const Caller& caller, int64_t asked) = 0;
  // Registers what a writer of begin_upload() finished. Errors: as upload_room().
  virtual Result<Asset> put_asset(const Caller& caller, const BlobInfo& blob, std::string filename,
                                  std::string content_type, Durability durability) = 0;
  Result<Asset> put_asset(const Caller& caller, const BlobInfo& blob, std::string filename,
                          std::string content_type) {
    return put_asset(caller, blob, std::move(filename), std::move(content_type), Durability::kNow);
  }
  // The same for a manifest with these files. Errors: not-found and gone, naming the file whose
  // asset is not there; malformed-bundle for a bundle in a bundle.
  virtual Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, std::string filename,
                                   const std::vector<BundleFile>& files, Durability durability) = 0;
  Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, std::string filename,
                           const std::vector<BundleFile>& files) {
    return put_bundle(caller, blob, std::move(filename), files, Durability::kNow);
  }
  virtual Result<Asset> get_asset(const Caller& caller, std::string_view id) = 0;
  // Calls `take` with one asset after the other, newest first, until it returns false. Assets of
  // several tenants with the same bytes are separate. Descriptions are left out.
  virtual Status list_assets(const Caller& caller, const AssetCursor& after,
                             const std::function<bool(const Asset&)>& take) = 0;
  // Results and grids stay; live jobs that need the asset, or a bundle with it, keep its blob until
  // they end, as do other tenants who have the same bytes. An admin deletes it of every tenant.
  virtual Status delete_asset(const Caller& caller, std::string_view id) = 0;

  // --- jobs
  // Durable when it returns, with its input, unless it is transient. Equal work of the same tenant
  // that is done already (same input, canonical options and algorithm version) comes back at once
  // with `cached` set, unless use_cache is off. Errors: not-found (asset, file of a bundle, grid,
  // sequence), gone, invalid-option, queue-full, too-many-requests (the tenant's own jobs, or their
  // records), quota-exceeded, idempotency-mismatch, shutting-down, storage-full where the disk has
  // no room for more rows.
  virtual Result<JobStatus> submit(const Caller& caller, const JobRequest& request,
                                   const SubmitOptions& options) = 0;
  // The status that submit() would return now, without a job: estimate, place in the queue and
  // expected times; `cached` if a result is there already. Errors: those of the input.
  virtual Result<JobStatus> estimate(const Caller& caller, const JobRequest& request) = 0;
  // In brief: is_brief().
  virtual Result<JobStatus> get(const Caller& caller, std::string_view id) = 0;
  // With all its texts, which may be megabytes: a few callers at a time, others wait.
  virtual Result<JobStatus> get_whole(const Caller& caller, std::string_view id) = 0;
  // Calls `take` with one job after the other until it gives false; it must be quick.
  virtual Status list(const Caller& caller, const JobQuery& query,
                      const std::function<bool(const ListedJob&)>& take) = 0;
  // Wakes `waker` after changes of the job for as long as the result lives, which must end before
  // the service. Watch first and read the status then: no change falls between. A job that does not
  // exist never changes.
  virtual std::unique_ptr<JobWatch> watch(std::string_view id, JobChange change,
                                          std::shared_ptr<Waker> waker) = 0;
  // The next events after `after_id`, oldest first; empty if there is none yet. Errors: not-found.
  virtual Result<std::vector<JobEvent>> events(const Caller& caller, std::string_view id,
                                               int64_t after_id) = 0;
  // Idempotent. A running job ends within a tile.
  virtual Result<JobStatus> cancel(const Caller& caller, std::string_view id) = 0;
  // Removes the record of a job that has ended; only the log keeps its id. Its result stays.
  // Errors: not-found, conflict for a job that has not ended.
  virtual Status forget(const Caller& caller, std::string_view id) = 0;
  // In brief, with its result's file, both as they are at one moment. Errors: not-found.
  virtual Result<JobAndResult> get_with_result(const Caller& caller, std::string_view id) = 0;
  // The bytes that a finished job left. Errors: not-found; conflict before it is done; gone when
  // they expired, made room for others or were damaged on disk.
  Result<StoredBlob> get_result(const Caller& caller, std::string_view job) {
    VOXELD_ASSIGN(const JobAndResult found, get_with_result(caller, job));
    return found.file;
  }
  // The same of a status that its caller was given a moment ago.
  virtual Result<StoredBlob> result_of(const JobStatus& status) = 0;

  // --- grids: native containers, by content id. Errors: not-found; gone as of get_result().
  virtual Result<StoredBlob> get_grid(const Caller& caller, std::string_view id) = 0;

  // The container that has tile `tile` of a job's grid, counted in their Morton order: while the
  // job runs, one of its finished tiles, nullopt if there is none yet; once it is done, its grid,
  // also for a tile that the grid does not have. status: one that its caller was given a moment
  // ago. Errors: conflict for a job that makes no grid of its own, or several; as get_result() of a
  // job that has ended.
  virtual Result<std::optional<TileFile>> tiles_of(const JobStatus& status, int64_t tile) = 0;

  // --- frames
  // While the job runs, too; those of a job that failed or was cancelled stay. Errors: not-found.
  virtual Result<JobFrames> frames(const Caller& caller, std::string_view job,
                                   const FrameRange& range) = 0;
  // Errors: not-found.
  virtual Result<SequenceManifest> get_sequence(const Caller& caller, std::string_view id) = 0;

  // --- the queue
  virtual Result<QueueView> queue(const Caller& caller) = 0;
  // --- what the caller's tenant may have, and has
  virtual TenantLimits limits(const Caller& caller) = 0;
  virtual Result<TenantUsage> usage(const Caller& caller) = 0;

  // --- state of the daemon, for readyz, metrics
  virtual std::vector<WorkerState> workers() = 0;
  virtual int64_t queued_jobs() = 0;
  // Ok if the database responds, the blob store is writable, the disk has room for a new job, a
  // worker is connected, and the daemon does not drain; else the reason.
  virtual Status ready() = 0;
  // Whether new jobs are refused for lack of room on the disk.
  virtual bool is_disk_short() = 0;
  // New work is refused from now on; running jobs go on.
  virtual void drain() = 0;
  // Puts running jobs back into the queue and ends workers and threads, as the destructor does;
  // calls that still run on other threads may go on.
  virtual void stop() = 0;

  // --- what jobs left, of the caller's tenant; an admin's calls are on what every tenant has
  // Newest first; those below `before_seq`, or all where that is 0.
  virtual Result<std::vector<KeptResult>> list_kept(const Caller& caller, KeptKind kind, int limit,
                                                    int64_t before_seq) = 0;
  // Deletes a whole result: its bytes, grid, sequence and frames, for all equal jobs that share it.
  // It stops counting at once; live jobs that use it continue. Errors: not-found, gone; conflict if
  // the job has not ended, or the grid is a frame of others.
  virtual Status delete_result(const Caller& caller, std::string_view job) = 0;
  virtual Status delete_grid(const Caller& caller, std::string_view id) = 0;
  virtual Status delete_sequence(const Caller& caller, std::string_view id) = 0;
};

struct JobServiceConfig {
  std::filesystem::path data_dir;
  std::vector<std::string> devices;
  int workers_per_device = 1;                 // processes; one works at a time
  std::string worker_executable;              // argv[0] of the daemon itself
  std::vector<std::string> worker_arguments;  // extra, e.g. --shader-dir
  int queued_jobs_max = limits::kQueuedJobsMax;
  bool start_workers = true;  // tests connect their own
  // False: jobs one after the other as they arrived, by one worker for each device.
  bool is_fair = true;
  // Bytes that started jobs may need in all, as they are estimated; 0: not limited.
  int64_t memory_bytes_max = 0;
  // A tenant's share beside the others'; null: all have the same. Thread-safe.
  std::function<int64_t(const std::string& tenant)> weight_of;
  // Which tasks a worker process may run after others, asked anew before each claim; null: all.
  // Thread-safe.
  std::function<WorkerIsolation()> isolation;
  TaskLimits limits;
  StorageLimits storage;
  StoreMatch store_match = StoreMatch::kRequired;
  KeptClock::Sources clock = KeptClock::real();  // of retention
  // Whether there are API keys now; null: never. A store that once had them does not open without,
  // unless it is told to forget that.
  std::function<bool()> has_keys;
  bool forgets_keys = false;
  std::function<TenantLimits(std::string_view tenant)> limits_of;  // null: none
  // Bytes of deleted files that a tenant's downloads keep; they count in its usage. Null: 0.
  // Thread-safe.
  std::function<int64_t(std::string_view tenant)> held_bytes;
  // Whether several tenants share the queue, so that none may take all of it
  // (jobs/records/quota.h); null: no. Thread-safe.
  std::function<bool()> is_queue_shared;
};

// Opens the store (recovering what an earlier process left: running jobs are queued again), starts
// the task server and the supervisor. `metrics` may be null.
Result<std::unique_ptr<JobService>> start_job_service(
    const JobServiceConfig& config, std::shared_ptr<prometheus::Registry> metrics);

}  // namespace voxeld
