// Stored results as their tenant lists and deletes them: results, grids and sequences. A result is
// deleted as a whole: its bytes, its grid, its sequence with the grids of its frames. Equal jobs
// share one; whichever of them it is deleted by, it is gone for all.
//
// A deleted row says `gone` and counts no more from the commit on. Its files go later, by the
// store's sweep, so that the answer's time tells nothing of who else has the same bytes; those that
// a live job works on go when it has ended.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/jobs/database/database.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/results.h"

namespace voxeld {

// Thread-safe; holds no state of its own.
class ResultStore {
 public:
  using Ids = std::vector<std::string>;
  explicit ResultStore(Database& database) : database_(database) {}

  // Newest first, those below `before_seq` (0: all). Several results with the same grid or
  // sequence are one entry, the newest.
  Result<std::vector<KeptResult>> list(const Caller& caller, KeptKind kind, int limit,
                                       int64_t before_seq);
  // Each returns the blobs that may go. Errors: not-found, gone; conflict for a job that has not
  // ended, and for a grid that is no result but a frame.
  Result<Ids> delete_of_job(const Caller& caller, std::string_view job);
  Result<Ids> delete_grid(const Caller& caller, std::string_view id);
  Result<Ids> delete_sequence(const Caller& caller, std::string_view id);
  // After the end of a job on the sequence. If that is not kept any more: the grids that may go,
  // because the job kept them back. The rows that nobody can ask for are removed.
  Result<Ids> drop_leftovers(std::string_view sequence);

 private:
  Database& database_;
};

}  // namespace voxeld
