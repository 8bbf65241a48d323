// Finished tiles that the gateway stores while a job runs, so a later attempt goes on after them. A
// restart, a crash of the driver or a preemption then costs only a few seconds of work.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/container/grid_format.h"
#include "proto/container/grid_writer.h"
#include "proto/result.h"
#include "server/base/clock.h"
#include "server/worker/grids/grid_file.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// Parts of a job. A part is a native container with the tiles of some steps of Voxelizer, after
// those of earlier parts. Its meta has the algorithm and the steps of all parts so far:
//   {"algorithm_version": 4, "steps_done": 120, "steps": 512}
class TileParts {
 public:
  // The run must outlive it.
  explicit TileParts(TaskRun& run) : run_(run) {}

  // Passes the tiles of the task's parts to `take` in order, both encoded and decoded. The task's
  // time slice is given up meanwhile. Returns how many of `steps` they cover; 0 if they are of
  // another algorithm, grid or codec, and are ignored. Errors: those of `take` and of time slices,
  // cancelled, internal for broken containers.
  using Take = std::function<Status(std::span<const EncodedTile>, std::vector<SparseTile>)>;
  Result<size_t> load(size_t steps, const GridHeader& header, const Take& take);

  // Hands the tiles since the last part to the gateway, when it is time or when the task is to be
  // preempted. Errors: cancelled, also if the task is preempted now. If a part cannot be stored for
  // another reason, the job goes on without it.
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
