// Finished tiles that the gateway keeps while a job runs, so that another attempt at it goes on
// after them: a restart, a crash of the driver or another user's turn costs a few seconds of work.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "proto/grid_format.h"
#include "proto/grid_writer.h"
#include "proto/result.h"
#include "proto/sparse_tile.h"
#include "server/base/stopwatch.h"
#include "server/worker/grid_file.h"
#include "server/worker/task_run.h"

namespace voxeld {

// A part is a native container with the tiles of some steps of Voxelizer, after those of the parts
// before. Its meta tells by which algorithm and how far all parts reach together:
//   {"algorithm_version": 4, "steps_done": 120, "steps": 512}
class TileParts {
 public:
  // The run must outlive it.
  explicit TileParts(TaskRun& run) : run_(run) {}

  // Gives the tiles of the task's parts to `take`, in their order, as they stand there and decoded.
  // The task's turn on the device is given up meanwhile. Returns how many of `steps` they are; 0
  // where they are of another algorithm, grid or codec, which are left aside. Errors: those of
  // `take` and of turns, cancelled, internal for containers that are broken.
  using Take = std::function<Status(std::span<const EncodedTile>, std::vector<SparseTile>)>;
  Result<size_t> load(size_t steps, const GridHeader& header, const Take& take);

  // Hands what the file has more than the last part to the gateway, when it is time to, or when the
  // task is to be parked. Errors: cancelled, also where it is parked now; what cannot be kept
  // otherwise is not, and the job goes on.
  Status reached(GridFile& file, size_t steps_done);

 private:
  Status load_part(const std::string& path, const Take& take);
  bool is_time() const;
  bool fits(size_t steps, const GridHeader& header, size_t& steps_done) const;

  TaskRun& run_;
  size_t steps_ = 0;
  int64_t position_ = 0;  // of the next part
  Stopwatch since_last_;
};

}  // namespace voxeld
