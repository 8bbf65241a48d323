// `voxeld doctor --rebuild`: rows for blobs that the database does not know, after it was lost or
// put back from an old copy.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "proto/result.h"

namespace voxeld {

struct RebuildReport {
  std::filesystem::path data_dir;
  std::string tenant;     // whose the found blobs are now
  int64_t known = 0;      // blobs that the database knew already
  int64_t assets = 0;     // made known: bundles included
  int64_t grids = 0;      // native containers
  int64_t sequences = 0;  // manifests of frames
  int64_t outputs = 0;    // left: results in other formats, which only their lost jobs named
  int64_t damaged = 0;    // left: the bytes are not those of the name
};

// Looks at every blob of the store and of its quarantine, and makes known what its first bytes say
// that it is: native containers are grids, manifests are sequences and bundles, and what is no
// other output of a job is an asset. Blobs do not tell whose they are: `tenant` owns all that is
// found; nullopt: nobody, as in a daemon without keys. The database and the blobs match afterwards.
// Errors: not-found where there is no store; conflict while a daemon runs on it; invalid-option
// where there are keys and no tenant, or for a name that no tenant can have; those of
// SqliteDatabase::open().
Result<RebuildReport> rebuild_store(const std::filesystem::path& data_dir,
                                    const std::optional<std::string>& tenant);

}  // namespace voxeld
