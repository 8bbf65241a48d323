#include "server/jobs/retention/store_sweep.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <string>
#include <utility>

#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/model/store_limits.h"

namespace voxeld {
namespace {

constexpr std::chrono::seconds kPause{1};
constexpr int64_t kSecondsPerExpiry = 10;
constexpr int64_t kSecondsPerOrphans = int64_t{24} * 60 * 60;
// Room is made down to this part of the limit, so that not every upload waits for it.
constexpr double kFullPart = 0.95;
constexpr double kMsPerDay = 24.0 * 60 * 60 * 1000;

int64_t days_ms(double days) {
  return static_cast<int64_t>(days * kMsPerDay);
}

// Calls `batch` until it did nothing. Returns how many it did.
template <typename Batch>
int64_t until_none(const char* what, Batch&& batch) {
  int64_t total = 0;
  while (true) {
    const Result<int64_t> done = batch();
    if (!done) {
      log::warn("the store cannot be swept", {{"step", what}, {"error", done.error().message()}});
      return total;
    }
    if (*done == 0) return total;
    total += *done;
  }
}

}  // namespace

StoreSweep::StoreSweep(const StorageLimits& limits, Retention& retention, AssetStore& assets,
                       BlobStore& blobs, JobMetrics& metrics, KeptClock& clock,
                       std::function<void()> note)
    : limits_(limits),
      retention_(retention),
      assets_(assets),
      blobs_(blobs),
      metrics_(metrics),
      clock_(clock),
      note_(std::move(note)),
      results_budget_(limits.keep_results_days),
      assets_budget_(limits.keep_assets_days),
      jobs_budget_(limits.keep_jobs_days) {}

StoreSweep::~StoreSweep() {
  stop();
}

void StoreSweep::start() {
  thread_ = std::thread([this] { run(); });
}

void StoreSweep::stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    wake_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void StoreSweep::look_at_deleted() {
  const MutexLock lock(mutex_);
  is_told_ = true;
  wake_.notify_all();
}

bool StoreSweep::pause() {
  const auto deadline = std::chrono::steady_clock::now() + kPause;
  ++seconds_;
  while (true) {
    {
      MutexLock lock(mutex_);
      while (!stopping_ && !is_told_) {
        if (wake_.wait_until(lock, deadline) == std::cv_status::timeout) return true;
      }
      if (stopping_) return false;
      is_told_ = false;
    }
    guarded("the removal of deleted files", [this] { remove_deleted(); });
    // Deletions and jobs that end without a pause must not keep the rest from its turn.
    if (std::chrono::steady_clock::now() >= deadline) return true;
  }
}

void StoreSweep::remove_deleted() {
  (void)until_none("deleted assets", [&] { return assets_.remove_unneeded(); });
  blobs_.empty_trash();
}

void StoreSweep::run() {
  do {
    guarded("the sweep of the store", [this] { sweep(); });
  } while (pause());
  guarded("the last uses", [this] { note_uses(); });
}

void StoreSweep::note_uses() {
  if (Status flushed = retention_.flush(); !flushed) {
    log::warn("cannot note what was used", {{"error", flushed.error().message()}});
  }
}

void StoreSweep::sweep() {
  note_();
  if (seconds_ % kSecondsPerOrphans == 0) {
    if (Status counted = blobs_.recount(); !counted) {
      log::warn("cannot count the store", {{"error", counted.error().message()}});
    }
    sweep_orphans();
  }
  if (seconds_ % kSecondsPerExpiry == 0) look_at_ages();
  if (const auto unnamed = retention_.remove_suspects(); !unnamed) {
    log::warn("the store cannot be swept",
              {{"step", "suspects"}, {"error", unnamed.error().message()}});
  }
  make_room();
  trim_records();
  remove_deleted();
  blobs_.disk().keep_ballast();
  metrics_.set_store(blobs_.bytes(), blobs_.damaged_count());
  const DiskRoom& disk = blobs_.disk();
  const auto free = disk.free_bytes(), total = disk.total_bytes(), reserve = disk.reserve_bytes();
  if (free && total && reserve) metrics_.set_disk(*free, *total, *reserve);
}

void StoreSweep::sweep_orphans() {
  const auto restored = retention_.restore_quarantined();
  if (!restored) {
    log::warn("cannot look into the quarantine", {{"error", restored.error().message()}});
  } else if (*restored > 0) {
    log::info("blobs are back from quarantine", {{"blobs", *restored}});
  }
  const auto orphans = retention_.quarantine_orphans(day_text(clock_.now_ms()));
  if (!orphans) {
    log::warn("cannot look for blobs that nothing names", {{"error", orphans.error().message()}});
  } else if (*orphans > 0) {
    log::warn("blobs that nothing names went to quarantine",
              {{"blobs", *orphans}, {"folder", (blobs_.root() / "quarantine").string()}});
  }
  if (limits_.keep_orphans_days == 0) return;
  const std::string last_day = day_text(clock_.now_ms() - days_ms(limits_.keep_orphans_days));
  const auto removed = Quarantine(blobs_.root()).remove_before(last_day);
  if (!removed) {
    log::warn("cannot empty the quarantine", {{"error", removed.error().message()}});
  } else if (*removed > 0) {
    log::info("removed blobs from quarantine", {{"blobs", *removed}, {"before", last_day}});
  }
}

void StoreSweep::look_at_ages() {
  if (const int64_t jump_ms = clock_.take_jump_ms(); jump_ms != 0) {
    log::warn("the system's clock jumped; ages do not count it", {{"seconds", jump_ms / 1000}});
  }
  note_uses();
  if (Status noted = retention_.note_ages(clock_.now_ms()); !noted) {
    log::warn("cannot note ages", {{"error", noted.error().message()}});
  }
  using Aged = Retention::Aged;
  expire(results_budget_, Aged::kResults, limits_.keep_results_days, "age",
         [this](int64_t before_ms, int64_t count_max) {
           return retention_.expire_aged_results(before_ms, count_max);
         });
  if (limits_.keep_results_days > 0) {
    const int64_t before_ms = clock_.now_ms() - days_ms(limits_.keep_results_days);
    metrics_.evicted("age",
                     until_none("frames", [&] { return retention_.expire_frames(before_ms); }));
  }
  expire(assets_budget_, Aged::kAssets, limits_.keep_assets_days, "asset-age",
         [this](int64_t before_ms, int64_t count_max) {
           return retention_.expire_assets(before_ms, count_max);
         });
  expire(jobs_budget_, Aged::kJobs, limits_.keep_jobs_days, "",
         [this](int64_t before_ms, int64_t count_max) {
           return retention_.trim_jobs(before_ms, count_max);
         });
}

// `reason` goes into the metrics; empty: it does not.
void StoreSweep::expire(AgeBudget& budget, Retention::Aged what, double keep_days,
                        const char* reason,
                        const std::function<Result<int64_t>(int64_t, int64_t)>& batch) {
  if (keep_days <= 0) return;
  const int64_t before_ms = clock_.now_ms() - days_ms(keep_days);
  const int64_t gone = until_none(reason, [&]() -> Result<int64_t> {
    VOXELD_ASSIGN(const int64_t left,
                  budget.left(clock_.now_ms(), [&] { return retention_.count(what); }));
    if (left <= 0) return int64_t{0};
    VOXELD_ASSIGN(const int64_t done, batch(before_ms, left));
    budget.take(done);
    return done;
  });
  if (*reason != '\0') metrics_.evicted(reason, gone);
  if (gone > 0 && budget.take_exhausted()) {
    log::warn("more is old than may go within an hour; the rest goes later",
              {{"what", *reason != '\0' ? reason : "jobs"}, {"gone", gone}});
  }
}

void StoreSweep::make_room() {
  if (limits_.store_bytes_max == 0 || blobs_.bytes() <= limits_.store_bytes_max) {
    is_full_ = false;
    return;
  }
  auto goal = static_cast<int64_t>(static_cast<double>(limits_.store_bytes_max) * kFullPart);
  // Of the room that assets leave, at most half is made at once.
  if (const auto assets = retention_.asset_bytes()) {
    goal = std::max(goal, *assets + (limits_.store_bytes_max - *assets) / 2);
  }
  constexpr int64_t kEver = std::numeric_limits<int64_t>::max();
  note_uses();
  int64_t evicted = 0;
  while (blobs_.bytes() > goal) {
    auto gone = retention_.expire_results(kEver, blobs_.bytes() - goal);
    if (gone && *gone == 0) gone = retention_.expire_frames(kEver);
    if (!gone) log::warn("cannot make room", {{"error", gone.error().message()}});
    if (!gone || *gone == 0) break;
    evicted += *gone;
  }
  is_full_ = blobs_.bytes() > limits_.store_bytes_max;
  metrics_.evicted("size", evicted);
  if (evicted > 0) {
    log::info("made room in the store", {{"results", evicted}, {"bytes", blobs_.bytes()}});
  }
}

// Down to half of the share, so that it is not reached again at once.
void StoreSweep::trim_records() {
  if (const auto record_bytes_max = blobs_.disk().record_bytes_max()) {
    const int64_t gone =
        until_none("records", [&] { return retention_.trim_records(*record_bytes_max / 2); });
    if (gone > 0) {
      log::info("removed the oldest records of tenants that have many", {{"records", gone}});
    }
  }
  (void)until_none("free pages of the database", [&] { return retention_.reclaim(); });
}

Status StoreSweep::room() const {
  if (is_full_) {
    return Error{ErrorCode::kStorageFull,
                 "the store is at its limit with what is not removed unasked; delete assets",
                 "at most " + std::to_string(limits_.store_bytes_max) + " bytes",
                 std::to_string(blobs_.bytes())};
  }
  return blobs_.disk().for_data();
}

}  // namespace voxeld
