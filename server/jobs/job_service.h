// The service that the HTTP API calls: assets, jobs, events, results. A facade over the job store
// (SQLite), the blob store and the task server. Thread-safe; no call waits for a job.
//
// Every call on something that a tenant owns says in whose name (caller.h). What the caller may not
// see is not-found, with the very words for what never was.
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

#include "proto/bundle_manifest.h"
#include "proto/job.h"
#include "proto/limits.h"
#include "proto/result.h"
#include "proto/sequence.h"
#include "proto/task_api.h"
#include "server/base/waker.h"
#include "server/jobs/asset_cursor.h"
#include "server/jobs/caller.h"
#include "server/jobs/job_query.h"
#include "server/jobs/job_watch.h"
#include "server/jobs/kept_clock.h"
#include "server/jobs/tenant_limits.h"
#include "server/jobs/worker_isolation.h"
#include "server/store/blob_store.h"

namespace prometheus {
class Registry;
}

namespace voxeld {

struct Asset {
  std::string id;  // AssetId: content hash of the upload, and how it is read
  std::string tenant;
  std::string filename;  // as given; may be empty
  std::string content_type;
  int64_t bytes = 0;
  int64_t created_ms = 0;
  std::string description_json;  // object from the last inspect job; empty until inspected
  bool existed = false;          // of put: the tenant had it already
};

// A stored file that the caller may read.
struct StoredBlob {
  std::string id;
  int64_t bytes = 0;
  std::filesystem::path path;
};

// A list of stored results.
enum class KeptKind { kResult, kGrid, kSequence };
struct KeptResult {
  int64_t seq = 0;   // order of arrival: what a list goes on behind
  std::string job;   // that made it
  std::string blob;  // of the result
  std::string grid, sequence;
  int64_t bytes = 0;  // of the result, the grid or the sequence's container, as the kind says
  std::string media_type, filename;
  int64_t created_ms = 0;
  int64_t frames = 0;  // of the sequence
};

struct SubmitOptions {
  std::string idempotency_key;  // empty: none
  bool transient = false;       // a one-shot request's job: cancelled when its client leaves
  double upload_ms = 0;         // goes into the job's timings
  std::string request_id;       // for the log
  std::string trace_id;
};

struct JobEvent {
  int64_t id = 0;         // the job's version: monotonic per job
  std::string type;       // "state", "progress"
  std::string data_json;  // JobStatus as a row: proto/job_text.h
};

struct ListedFrame {
  int64_t index = 0;  // among the request's frames
  SequenceFrame frame;
};

// The frames of a job with an index from `first` on, at most `count` of them.
struct FrameRange {
  int64_t first = 0;
  int64_t count = limits::kFramesMax;
};

// The frames that a job has made so far.
struct JobFrames {
  std::string job;
  std::string sequence;             // once it is done, when it made one
  int64_t frames_done = 0;          // of all, not of the range
  int64_t frames_total = 0;         // 0: not known, or no sequence
  std::vector<ListedFrame> frames;  // of the range, by ascending index
};

struct WorkerState {
  std::string device, renderer, driver;
  int slot = 0;  // among the processes of the device
  int64_t pid = 0;
  bool connected = false;
  int64_t restarts = 0;
  std::string task;        // job id it runs, or empty
  std::string last_error;  // of a device that cannot be opened
  std::string device_json;
  std::string sandbox;       // "full", "off", or what is missing
  int64_t memory_bytes = 0;  // that its process takes; 0: not looked at yet
  DeviceMemory device_memory;
};

// The queue as one caller may see it.
struct QueueView {
  struct Job {
    std::string tenant;
    std::string device;  // that runs it, or empty
    JobStatus status;
  };
  struct Device {
    std::string device, renderer;
    int64_t workers = 0;  // that are connected
    int64_t workers_busy = 0;
    std::vector<std::string> jobs;  // those of the caller that run on it
  };
  std::vector<Device> devices;
  std::vector<Job> jobs;  // the caller's, or an admin's all: running ones, then by position
  int64_t queued = 0, running = 0;                // of all tenants
  int64_t others_queued = 0, others_running = 0;  // of tenants that the caller does not see
};

class JobService {
 public:
  using Clock = std::chrono::steady_clock;
  virtual ~JobService() = default;

  // --- assets
  // Begins an upload of at most `bytes_max` bytes. Errors: storage-full.
  virtual Result<BlobWriter> begin_upload(int64_t bytes_max) = 0;
  // How many bytes an upload of the caller may have beside what its tenant keeps; `asked` of them,
  // or 0 where that is not known. What the tenant has already costs nothing, so an upload that can
  // be one of its blobs, by its length, is let in; put_asset() knows by its hash. Errors:
  // quota-exceeded, payload-too-large.
  virtual Result<int64_t> upload_room(const Caller& caller, int64_t asked) = 0;
  // Registers what a writer of begin_upload() finished. Errors: as upload_room().
  virtual Result<Asset> put_asset(const Caller& caller, const BlobInfo& blob, std::string filename,
                                  std::string content_type) = 0;
  // The same for a manifest with these files. Errors: not-found and gone, naming the file whose
  // asset is not there; malformed-bundle for a bundle in a bundle.
  virtual Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, std::string filename,
                                   const std::vector<BundleFile>& files) = 0;
  virtual Result<Asset> get_asset(const Caller& caller, std::string_view id) = 0;
  // Calls `take` with one asset after the other, newest first, until it gives false. Those of
  // several tenants with the same bytes are several; descriptions are left out.
  virtual Status list_assets(const Caller& caller, const AssetCursor& after,
                             const std::function<bool(const Asset&)>& take) = 0;
  // Results and grids stay; live jobs that need the asset, or a bundle with it, keep its blob until
  // they end, as do other tenants who have the same bytes. An admin deletes it of every tenant.
  virtual Status delete_asset(const Caller& caller, std::string_view id) = 0;

  // --- jobs
  // Durable when it returns. Equal work of the same tenant that is done already (same input,
  // canonical options and algorithm version) comes back at once with `cached` set, unless use_cache
  // is off. Errors: not-found (asset, file of a bundle, grid, sequence), gone, invalid-option,
  // queue-full, too-many-requests (the tenant's own jobs), idempotency-mismatch, shutting-down,
  // storage-full where the disk has no room for more rows.
  virtual Result<JobStatus> submit(const Caller& caller, const JobRequest& request,
                                   const SubmitOptions& options) = 0;
  // The status that submit() would return now, without a job: estimate, place in the queue and
  // expected times; `cached` if a result is there already. Errors: those of the input.
  virtual Result<JobStatus> price(const Caller& caller, const JobRequest& request) = 0;
  // In brief: is_brief().
  virtual Result<JobStatus> get(const Caller& caller, std::string_view id) = 0;
  // With all its texts, which may be megabytes: a few callers at a time, others wait.
  virtual Result<JobStatus> get_whole(const Caller& caller, std::string_view id) = 0;
  // Calls `take` with one job after the other, in brief, until it gives false; it must be quick.
  // Errors: invalid-option for `query.after`.
  virtual Status list(const Caller& caller, const JobQuery& query,
                      const std::function<bool(const JobStatus&)>& take) = 0;
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
  // The bytes that a finished job left. Errors: not-found; conflict before it is done; gone when
  // they expired, made room for others or were damaged on disk.
  Result<StoredBlob> get_result(const Caller& caller, std::string_view job) {
    VOXELD_ASSIGN(const JobStatus status, get(caller, job));
    return result_of(status);
  }
  // The same of a status that its caller was given a moment ago.
  virtual Result<StoredBlob> result_of(const JobStatus& status) = 0;

  // --- grids: native containers, by content id. Errors: not-found; gone as of get_result().
  virtual Result<StoredBlob> get_grid(const Caller& caller, std::string_view id) = 0;

  // --- frames
  // While the job runs, too; those of a job that failed or was cancelled stay. Errors: not-found.
  virtual Result<JobFrames> frames(const Caller& caller, std::string_view job,
                                   const FrameRange& range) = 0;
  // Errors: not-found.
  virtual Result<SequenceManifest> get_sequence(const Caller& caller, std::string_view id) = 0;

  // Live jobs, at most `limit` that wait, and who works.
  virtual Result<QueueView> queue(const Caller& caller, int limit) = 0;
  // --- what the caller's tenant may have, and has
  virtual TenantLimits limits(const Caller& caller) = 0;
  virtual Result<TenantUsage> usage(const Caller& caller) = 0;

  // --- state of the daemon, for readyz, metrics
  virtual std::vector<WorkerState> workers() = 0;
  virtual int64_t queued_jobs() = 0;
  // database answers, blob store writable, the disk's reserve is free, a worker connected, not
  // draining; else why not.
  virtual Status ready() = 0;
  // New work is refused from now on; running jobs go on.
  virtual void drain() = 0;
  // Puts running jobs back into the queue and ends workers and threads, as the destructor does;
  // calls that still run on other threads may go on.
  virtual void stop() = 0;

  // --- what jobs left, of the caller's tenant; an admin's calls are on what every tenant has
  // Newest first; those below `before_seq`, or all where that is 0.
  virtual Result<std::vector<KeptResult>> list_kept(const Caller& caller, KeptKind kind, int limit,
                                                    int64_t before_seq) = 0;
  // A result goes as a whole: its bytes, grid, sequence and frames, for all equal jobs that it
  // answered. It counts no more at once; live jobs that work on it go on. Errors: not-found, gone;
  // conflict where the job has not ended, or the grid is a frame of others.
  virtual Status delete_result(const Caller& caller, std::string_view job) = 0;
  virtual Status delete_grid(const Caller& caller, std::string_view id) = 0;
  virtual Status delete_sequence(const Caller& caller, std::string_view id) = 0;
};

// When a worker that runs a task is taken for lost, and killed if it is ours. Seconds.
struct TaskLimits {
  // Workers report at least every 200 ms; one that is silent for so long is stopped or stuck.
  double silence_seconds_max = 30.0;
  // A cancel takes effect within a tile, or the worker ends.
  double cancel_seconds_max = 10.0;
  // It reports, but says the same each time: a shader or a parser that never ends.
  double stall_seconds_max = 600.0;
  // Duration of one attempt: deadline-exceeded.
  double job_seconds_max = 86'400.0;
  // Memory of one worker process: grid-too-large. 0: no limit.
  int64_t worker_memory_bytes_max = 0;
  // Memory of all worker processes together: the one that takes the most beyond what its task was
  // granted ends, and its job is put back. 0: no limit.
  int64_t all_workers_memory_bytes_max = 0;
  // Bytes that one worker has written for its task: storage-full. 0: a quarter of the disk.
  int64_t scratch_bytes_max = 0;
};

// Limits of the store in bytes and days. 0: no limit. A blob that is read counts as used.
struct StorageLimits {
  int64_t store_bytes_max = 0;  // over it, results go that were not used for the longest time
  int64_t disk_reserve_bytes = int64_t{1} << 30;  // see DiskRoom
  double keep_results_days = 0;                   // since they were used last
  double keep_assets_days = 0;                    // the same
  double keep_jobs_days = 0;                      // rows of jobs, since they ended
  double keep_orphans_days = 7;  // blobs that no row names, in quarantine (0: without limit)
};

// Whether the database has to be the one of the blobs (store_identity.h). kAdopt: it goes on with
// what it knows, and the blobs that it does not know go to quarantine.
enum class StoreMatch { kRequired, kAdopt };

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
  // Whether several tenants share the queue, so that none may take all of it (jobs/quota.h); null:
  // no. Thread-safe.
  std::function<bool()> is_queue_shared;
};

// Opens the store (recovering what an earlier process left: running jobs are queued again), starts
// the task server and the supervisor. `metrics` may be null.
Result<std::unique_ptr<JobService>> start_job_service(
    const JobServiceConfig& config, std::shared_ptr<prometheus::Registry> metrics);

}  // namespace voxeld
