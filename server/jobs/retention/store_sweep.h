// The thread that keeps the store within its limits.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>

#include "server/base/thread_annotations.h"
#include "server/jobs/events/job_metrics.h"
#include "server/jobs/model/store_limits.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/retention/age_budget.h"
#include "server/jobs/retention/kept_clock.h"
#include "server/jobs/retention/retention.h"
#include "server/store/blob_store.h"

namespace voxeld {

// Thread-safe. Looks at the store's size, at tenants' shares of rows, at deleted assets and at its
// suspects every second, at deleted assets also when it is told to, and at ages every ten; among
// all blobs it looks for those that no row names, which go to quarantine, when it starts and once a
// day.
class StoreSweep {
 public:
  // `note` is called every second, on the sweep's thread.
  StoreSweep(const StorageLimits& limits, Retention& retention, AssetStore& assets,
             BlobStore& blobs, JobMetrics& metrics, KeptClock& clock, std::function<void()> note);
  ~StoreSweep();
  void start();
  void stop() EXCLUDES(mutex_);
  // Expires old data, within AgeBudget; the thread calls it every ten seconds.
  void look_at_ages();
  // Something was deleted: its files go soon, on the sweep's thread.
  void look_at_deleted() EXCLUDES(mutex_);

  // Whether an upload may begin. Errors: storage-full when the disk has less than its reserve left,
  // or when the store is at its limit and nothing in it may be removed.
  Status room() const;

 private:
  void run();
  void note_uses();
  void sweep();
  void sweep_orphans();
  void make_room();
  void trim_records();
  void expire(AgeBudget& budget, Retention::Aged what, double keep_days, const char* reason,
              const std::function<Result<int64_t>(int64_t before_ms, int64_t count_max)>& batch);
  void remove_deleted();
  // Returns at the next second. False: stop.
  bool pause() EXCLUDES(mutex_);

  const StorageLimits limits_;
  Retention& retention_;
  AssetStore& assets_;
  BlobStore& blobs_;
  JobMetrics& metrics_;
  KeptClock& clock_;
  const std::function<void()> note_;
  AgeBudget results_budget_, assets_budget_, jobs_budget_;  // of the thread
  int64_t seconds_ = 0;               // of the thread: how often pause() returned
  std::atomic<bool> is_full_{false};  // over the limit, and nothing may go
  Mutex mutex_;
  CondVar wake_;
  bool stopping_ GUARDED_BY(mutex_) = false;
  bool is_told_ GUARDED_BY(mutex_) = false;  // that something was deleted
  std::thread thread_;
};

}  // namespace voxeld
