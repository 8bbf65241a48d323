// The frames of a sequence in their containers, as formats and pictures read them.
#pragma once

#include <filesystem>
#include <vector>

#include "proto/options.h"
#include "server/grid/frame_source.h"
#include "server/worker/make_frames.h"
#include "server/worker/task_run.h"

namespace voxeld {

// The sequence that a task has as its input, and those of its frames that `frames` selects. Stage:
// parse. Errors: those of the manifest; invalid-option of select_frames().
Result<MadeSequence> open_sequence(TaskRun& run, const AnimationOptions& options);

// What level and region of the request make of each frame. Each frame that is read is progress, and
// looks whether the task was cancelled.
class ContainerFrames final : public FrameSource {
 public:
  // `sequence` and the run must outlive it. Errors: invalid-option for a region that is not in the
  // grid.
  static Result<ContainerFrames> open(TaskRun& run, const MadeSequence& sequence,
                                      const OutputOptions& output);

  const Grid& common() const override { return common_; }
  size_t frame_count() const override { return sequence_->paths.size(); }
  double time_s(size_t index) const override { return sequence_->manifest.frames[index].time_s; }
  double fps() const override { return sequence_->manifest.fps; }
  Result<Grid> frame(size_t index) const override;

 private:
  ContainerFrames(TaskRun& run, const MadeSequence& sequence, const OutputOptions& output)
      : run_(&run), sequence_(&sequence), output_(output) {}

  TaskRun* run_;
  const MadeSequence* sequence_;
  OutputOptions output_;
  Grid common_;
};

// The place of a sequence's grids.
GridSpec sequence_spec(const SequenceManifest& manifest);

// Writes the frames as the request's result. Stage: encode. Errors: those of write_sequence().
Status write_frames(TaskRun& run, const MadeSequence& sequence, const OutputOptions& output);

}  // namespace voxeld
