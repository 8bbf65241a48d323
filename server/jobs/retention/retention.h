// Expiry of stored data: results and frames that were not used for long, assets if configured, rows
// of jobs that ended, and blobs that no row names.
//
// A result expires as a whole: its blob, its grid, its sequence and the frames of its job. First
// its rows say so and that is committed, then the files go; what a crash leaves in between is found
// by quarantine_orphans().
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/database/database.h"
#include "server/store/blob_store.h"

namespace voxeld {

// Thread-safe. Every call that changes rows does a batch, so that it holds the writer for some
// milliseconds, and returns how many it did; 0: there are no more.
class Retention {
 public:
  static constexpr int64_t kAllBytes = std::numeric_limits<int64_t>::max();
  Retention(Database& database, BlobStore& blobs) : database_(database), blobs_(blobs) {}

  // Somebody was given this blob, or a job works on it. Kept in memory until flush(), which notes
  // it where the last use that is known is older than ten minutes.
  void touch(const std::string& blob) EXCLUDES(mutex_);
  Status flush() EXCLUDES(mutex_);

  // Bytes of all assets, which never expire by size.
  Result<int64_t> asset_bytes();
  // Results that were used last before `used_before_ms` of the wall clock, the oldest first. Those
  // that live jobs work on stay. Ends early where that frees `bytes_wanted`.
  Result<int64_t> expire_results(int64_t used_before_ms, int64_t bytes_wanted = kAllBytes);

  // Notes the age of what was used, ended or deleted since the last call. All other times of ages
  // are those of this clock (KeptClock), never the wall clock's.
  Status note_ages(int64_t kept_now_ms);
  // The number of results, assets or ended jobs, of which an age limit may take a part.
  enum class Aged { kResults, kAssets, kJobs };
  Result<int64_t> count(Aged what);
  // As expire_results(), by age, at most `count_max`.
  Result<int64_t> expire_aged_results(int64_t aged_before_ms, int64_t count_max);
  // Frames of jobs that failed or were cancelled before that.
  Result<int64_t> expire_frames(int64_t aged_before_ms);
  // As if their tenants had deleted them.
  Result<int64_t> expire_assets(int64_t aged_before_ms, int64_t count_max);
  // Rows of jobs that ended before that, with their events, and rows of deleted assets. Results
  // that have not expired stay, as equal jobs get them.
  Result<int64_t> trim_jobs(int64_t aged_before_ms, int64_t count_max);

  // Trims each tenant whose records take more than this (TenantUsage::record_bytes): rows of jobs
  // that ended, in the order of their arrival, then rows of deleted assets.
  Result<int64_t> trim_records(int64_t record_bytes_max);
  // Gives room of removed rows back to the disk. Returns how many bytes.
  Result<int64_t> reclaim() { return database_.reclaim(); }

  // The suspects of the store that no row names: of failed uploads, and blobs that were being
  // uploaded, or worked on, when they were deleted.
  Result<int64_t> remove_suspects();
  // Moves blobs that the database does not know, among all of them, to the quarantine of the day: a
  // killed process left them, or a restored database lacks them. Removes blobs that it knows as
  // deleted or expired. Reads much.
  Result<int64_t> quarantine_orphans(std::string_view day);
  // Moves those back that a row names by now: the right database is back, or the same bytes were
  // uploaded again.
  Result<int64_t> restore_quarantined();

 private:
  Status note_use(const std::string& id, std::string_view uses, int64_t at_ms);
  Result<int64_t> expire_results_by(std::string_view column, int64_t after_ms, int64_t before_ms,
                                    int64_t count_max, int64_t bytes_wanted);
  Result<int64_t> trim_records_of(std::string_view tenant);
  // `quarantine_day`: as of remove_blobs().
  Result<int64_t> remove(const std::vector<std::string>& ids, std::string_view quarantine_day = {});
  Result<int64_t> remove_unnamed(const std::vector<std::string>& ids,
                                 std::string_view quarantine_day);
  Database& database_;
  BlobStore& blobs_;
  Mutex mutex_;
  std::unordered_map<std::string, int64_t> used_ms_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
