// The frames of a sequence in their containers, as the formats and the images read them.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "proto/options/options.h"
#include "server/formats/native_sequence.h"
#include "server/grid/frame_source.h"
#include "server/grid/tile_source.h"
#include "server/worker/frames/make_frames.h"
#include "server/worker/task/serial_queue.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// Opens the task's input sequence and selects its frames by `frames`. Stage: parse. Errors: those
// of the manifest; invalid-option of select_frames().
Result<MadeSequence> open_sequence(TaskRun& run, const AnimationOptions& options);

// Reads frames and applies the request's level, region, crop, mirror and palette to each. For crop,
// which is to the cells that any frame occupies, all frames are read once more. Each frame read
// reports progress and checks for cancellation.
class ContainerFrames final : public FrameSource {
 public:
  // `sequence` and the run must outlive it. Errors: invalid-option for a region outside the grid.
  static Result<ContainerFrames> open(TaskRun& run, const MadeSequence& sequence,
                                      const OutputOptions& asked);

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
  CellBox crop_;  // of all frames, if the output is cropped
  Grid common_;
};

// The placement of a sequence's grids.
GridSpec sequence_spec(const SequenceManifest& manifest);

// Writes the frames as the request's result. Stage: encode. Errors: those of write_sequence().
Status write_frames(TaskRun& run, const MadeSequence& sequence, const OutputOptions& output);

// Writes the native sequence on a thread of its own while frames are made, each from its container
// as soon as it is reported. The bytes equal those of write_frames().
class SequenceBeside final : public FrameListener {
 public:
  static bool fits(const OutputOptions& output);  // whether its output is the requested one

  // The run must outlive it.
  SequenceBeside(TaskRun& run, const OutputOptions& output)
      : run_(run), output_(output), side_(0) {}
  // Stops at the next batch of tiles and removes an unfinished file.
  ~SequenceBeside() override { is_wanted_ = false; }
  SequenceBeside(const SequenceBeside&) = delete;
  SequenceBeside& operator=(const SequenceBeside&) = delete;

  Status begin(const SequenceManifest& manifest) override;
  Status frame(double time_s, const std::filesystem::path& container) override;
  // Writes the remaining frames, then lists the result. Stage: encode. Errors: as NativeSequence.
  Status finish();

 private:
  Status before_tiles(size_t done, size_t total);

  TaskRun& run_;
  const OutputOptions output_;
  std::filesystem::path path_;
  Grid common_;  // without tiles
  size_t frame_count_ = 0;
  std::unique_ptr<NativeSequence> file_;
  std::atomic<bool> is_wanted_ = true, is_last_stage_ = false;
  SerialQueue side_;  // last: it uses the above
};

}  // namespace voxeld
