// asset -> frames: voxelizes an animation frame by frame into containers, which are reported as
// they are finished.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/messages/sequence.h"
#include "server/worker/frames/frame_times.h"
#include "server/worker/frames/moving_scene.h"
#include "server/worker/task/task_run.h"

namespace voxeld {

// An animation of an asset as the request's options select and place it.
struct Clip {
  MovingScene moving;
  FrameTimes times;
  GridSpec spec;  // for all frames: around the union of their boxes
};
// Stages: parse, place. Errors: those of loading, MovingScene, frame_times() and place_grid().
Result<Clip> open_clip(TaskRun& run, const RequestOptions& options);

// A sequence whose containers are known by path.
struct MadeSequence {
  SequenceManifest manifest;
  std::vector<std::filesystem::path> paths;  // of the frames' containers
};

// Is notified of the frames while they are made.
class FrameListener {
 public:
  virtual ~FrameListener() = default;
  // Called once, before the first frame, with a manifest that has no frames yet.
  virtual Status begin(const SequenceManifest& manifest) = 0;
  // Called for each reported frame in order, on the thread that reports. An error ends the making.
  virtual Status frame(double time_s, const std::filesystem::path& container) = 0;
};

// Voxelizes all frames, reports each, and lists the sequence's manifest. A frame's container is
// that of a grid of its own. It does not mention animation, number or time, so equal frames are one
// blob.
//
// Three steps run at once. The next frame is posed, and its vertices are moved unless the device
// will do that. This frame is voxelized. The frames before it are encoded, hashed, written and
// reported. Tiles go to the file as they come; at most a few batches wait. Work that frames share
// is done once (SharedFrames).
//
// `listener`, if any, must outlive the call.
//
// Meta: frames, fps, animation, and the facts that frames have in common. Stages: voxelize, and
// encode: only the time that voxelizing waits for it. Errors: those of voxelizing; cancelled.
Result<MadeSequence> make_frames(TaskRun& run, Clip& clip, const RequestOptions& options,
                                 FrameListener* listener = nullptr);

// {name, number, duration_s, frame_rate} of the clip's animation.
nlohmann::json animation_facts(const Clip& clip);

}  // namespace voxeld
