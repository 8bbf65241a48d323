// Frames in the database: those that jobs have left so far, and the sequences that finished jobs
// are. Their containers are in the blob store.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/sequence.h"
#include "proto/messages/task_api.h"
#include "server/jobs/database/database.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/results.h"
#include "server/store/object_store.h"

namespace voxeld {

// Frames of a stored sequence, and the bytes of all their grids.
struct SequenceSize {
  int64_t frames = 0, bytes = 0;
};

// Thread-safe; holds no state of its own.
class FrameStore {
 public:
  FrameStore(Database& database, const ObjectStore& blobs) : database_(database), blobs_(blobs) {}

  // Lists a frame of a running job whose container `grid` is in the store, in place of an earlier
  // attempt's of the same index. Returns how many the job has now; nullopt when another worker owns
  // the job and nothing changed. Errors: quota-exceeded and payload-too-large where the job's
  // tenant would keep more than `bytes_max` (0: any).
  // `replaced`: the grid of that earlier frame, which may go; empty if there was none.
  Result<std::optional<int64_t>> add(const TaskFrame& frame, const BlobInfo& grid,
                                     int64_t frames_total, int64_t bytes_max,
                                     std::string* replaced = nullptr);
  // By ascending index; those of earlier attempts count. The caller must have checked
  // that the job may be seen.
  Result<std::vector<ListedFrame>> of_job(std::string_view job, const FrameRange& range = {});

  // The manifest of a sequence that a finished job of the caller left. Errors: not-found, gone.
  Result<SequenceManifest> read(const Caller& caller, std::string_view sequence);
  // The manifest in a stored blob; a live job may read one that was deleted meanwhile.
  Result<SequenceManifest> read_blob(std::string_view id);
  // Without frames where no finished job has left it. The caller must have checked that it may be
  // seen.
  Result<SequenceSize> size_of(std::string_view sequence);
  // Whether a manifest that a worker brings names exactly the frames that its job lists, whose
  // number is returned. Errors: internal.
  Result<int64_t> check(std::string_view job, std::string_view sequence);

 private:
  Database& database_;
  const ObjectStore& blobs_;
};

}  // namespace voxeld
