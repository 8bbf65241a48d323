// The frames of a sequence in their containers, as formats and pictures read them.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "proto/options.h"
#include "server/formats/native_sequence.h"
#include "server/grid/frame_source.h"
#include "server/worker/make_frames.h"
#include "server/worker/side_thread.h"
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
  std::optional<std::filesystem::path> container(size_t index) const override;
  Status before_tiles(size_t done, size_t total) const override;

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

// Writes the native sequence of whole frames on a thread of its own while they are made: each from
// its container, as soon as that is reported. Has the bytes that write_frames() gives.
class SequenceBeside final : public FrameListener {
 public:
  static bool fits(const OutputOptions& output);  // whether it gives what the request asks for

  // The run must outlive it.
  SequenceBeside(TaskRun& run, const OutputOptions& output)
      : run_(run), output_(output), side_(0) {}
  // Stops at the next batch of tiles; a file that was not finished is removed.
  ~SequenceBeside() override { is_wanted_ = false; }
  SequenceBeside(const SequenceBeside&) = delete;
  SequenceBeside& operator=(const SequenceBeside&) = delete;

  Status begin(const SequenceManifest& manifest) override;
  Status frame(double time_s, const std::filesystem::path& container) override;
  // The frames that are left, then lists the result. Stage: encode. Errors: as NativeSequence.
  Status finish();

 private:
  Status before_tiles(size_t done, size_t total);

  TaskRun& run_;
  const OutputOptions output_;
  std::filesystem::path path_;
  GridSpec spec_;
  size_t frame_count_ = 0;
  std::unique_ptr<NativeSequence> file_;
  std::atomic<bool> is_wanted_ = true, is_last_stage_ = false;
  SideThread side_;  // last: it uses the above
};

}  // namespace voxeld
