// Expiry of results and frames: their rows say so, and the blobs that they named may go.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/jobs/database/sql.h"

namespace voxeld {

struct ExpiringResult {
  int64_t seq = 0;  // of its row
  std::string job;  // that made it
};
// Why something is not kept any more, which its `gone` tells.
enum class Expiry { kAged, kDeleted };
// Inside the caller's transaction: the result, with its grid, its sequence and their frames, is not
// kept from now on. Adds the blobs that may go to `ids`.
Status expire_result(SqlConnection& connection, const ExpiringResult& result, Expiry why,
                     std::vector<std::string>& ids);
// The same of the frames of a job. Their rows stay until the job's goes.
Status expire_frames_of(SqlConnection& connection, std::string_view job, Expiry why,
                        std::vector<std::string>& ids);
// Inside the caller's transaction: removes the rows of an expired result, and of its frames, that
// nobody can ask for, unless a live job works on its sequence.
Status drop_rows(SqlConnection& connection, const ExpiringResult& result);
// Inside the caller's transaction: removes the rows of a job that has ended: its own, its events,
// its Idempotency-Key, and those of its result and frames where these have expired. A result that
// has not expired stays, since equal jobs get it. Adds the blobs that may go to `ids`.
Status forget_job(SqlConnection& connection, std::string_view id, Expiry why,
                  std::vector<std::string>& ids);

// Adds the texts of the first column of all rows, without empty ones.
Status collect_ids(SqlStatement rows, std::vector<std::string>& ids);

}  // namespace voxeld
