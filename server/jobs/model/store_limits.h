// Limits of the store, and how its database is matched with its blobs.
#pragma once

#include <cstdint>

namespace voxeld {

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

}  // namespace voxeld
