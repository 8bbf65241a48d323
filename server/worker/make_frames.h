// asset -> frames: an animation voxelized frame by frame into containers that are reported as they
// get done.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/sequence.h"
#include "server/worker/frame_times.h"
#include "server/worker/moving_scene.h"
#include "server/worker/task_run.h"

namespace voxeld {

// What a request's animation options make of an asset.
struct Clip {
  MovingScene moving;
  FrameTimes times;
  GridSpec spec;  // of all frames: around the union of their boxes
};
// Stages: parse, place. Errors: those of loading, MovingScene, frame_times() and place_grid().
Result<Clip> open_clip(TaskRun& run, const RequestOptions& options);

// A sequence while it is known where its containers are.
struct MadeSequence {
  SequenceManifest manifest;
  std::vector<std::filesystem::path> paths;  // of the frames' containers
};

// Hears of the frames while they are made.
class FrameListener {
 public:
  virtual ~FrameListener() = default;
  // Once, before the first of them: the manifest, whose frames are not there yet.
  virtual Status begin(const SequenceManifest& manifest) = 0;
  // Of each that was reported, in their order, on the thread that reports. Its error ends the
  // making.
  virtual Status frame(double time_s, const std::filesystem::path& container) = 0;
};

// Voxelizes all frames, reports each, and lists the sequence's manifest. A frame's container is
// that of a grid of its own: it says nothing of animation, number and time, so that equal frames
// are one blob.
//
// Three things go on at once: the next frame's pose is found, and its vertices are moved unless the
// device will do that; this one is voxelized; and the ones before it are encoded, hashed, written
// and reported. Tiles go to the file as they come; a few batches of them wait at most. What frames
// share is not made anew (SharedFrames).
//
// `listener`, if any, must outlive the call.
//
// Meta: frames, fps, animation, and what frames have in common. Stages: voxelize, with encode
// beside it: the time that voxelizing waits for it. Errors: those of voxelizing; cancelled.
Result<MadeSequence> make_frames(TaskRun& run, Clip& clip, const RequestOptions& options,
                                 FrameListener* listener = nullptr);

// {name, number, duration_s, frame_rate} of the clip's animation.
nlohmann::json animation_facts(const Clip& clip);

}  // namespace voxeld
