// Opens the database of a store and holds it against the mark beside the blobs
// (server/store/store_mark.h), so that no other, older or empty database takes the blobs for
// orphans.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "proto/result.h"
#include "server/jobs/database/database.h"
#include "server/jobs/model/store_limits.h"
#include "server/store/blob_store.h"
#include "server/store/store_mark.h"

namespace voxeld {

// The database raises its generation with every commit that changes rows, and then the mark's.
struct StoreDatabase {
  std::unique_ptr<StoreMarkFile> mark;  // before the database, which writes to it
  std::unique_ptr<Database> database;
};

// DIR/jobs.sqlite; made where the store has no blobs. Errors: conflict, with what to do, for a
// database that is missing, empty, another store's, or older than the blobs' mark; those of
// SqliteDatabase::open().
Result<StoreDatabase> open_store_database(const BlobStore& blobs, StoreMatch match);

}  // namespace voxeld
