// The rows that keep a blob in the store: of assets, live jobs, results and frames.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/jobs/database/database.h"
#include "server/store/object_store.h"

namespace voxeld {

// Whether a row needs the blob.
Result<bool> is_needed(SqlConnection& connection, std::string_view id);

// Removes those of `ids` that nothing needs, and that are not pinned, by `remove`: of the store, or
// to its quarantine. To be called inside database.write(), where nothing can start to need one
// meanwhile. A file cannot be rolled back, so both count: what is committed, and what the
// transaction that runs is about to commit. Returns those that are no longer there.
Result<std::vector<std::string>> remove_blobs(
    SqlConnection& writer, Database& database, const std::vector<std::string>& ids,
    const std::function<Status(const std::string& id)>& remove);

// A blob that a row names, for reading: `what` ("the result of the job j-…") is there and intact.
// Errors: gone when it was removed to make room, expired, or is damaged, with the `remedy` ("submit
// the job again").
Result<BlobInfo> named_blob(const ObjectStore& blobs, std::string_view id, std::string_view what,
                            std::string_view remedy);

}  // namespace voxeld
