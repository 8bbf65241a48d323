// An asset's scene whose vertices follow the frames of an animation.
//
// A device moves the vertices if it voxelizes them by pipeline compute in batches and its 64-bit
// floats equal the CPU's (voxel/pipelines/device_skin.h). Otherwise the CPU moves them, in doubles.
// Both give the same bits, so every pipeline snaps the same numbers and frames are equal on all of
// them.
//
// The CPU works while the frame before is voxelized: 70 microseconds of one core for Bob with lamp
// (875 vertices, 33 joints).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include <glm/mat4x4.hpp>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/scene/core/animated_scene.h"
#include "server/voxel/frames/shared_frames.h"

namespace voxeld {

class MovingScene {
 public:
  // Opens the animation that the options name, or the first one. Root motion is stripped to where
  // it begins. Errors: invalid-option for an asset without animations, those of find_animation()
  // and pose_at().
  static Result<MovingScene> open(std::shared_ptr<const AnimatedScene> animated,
                                  const AnimationOptions& options, UpAxis up);

  const AnimationInfo& animation() const { return animated_->animations[animation_]; }
  size_t animation_index() const { return animation_; }
  // The bind pose; the functions below do not change it.
  const Scene& bind() const { return animated_->scene; }
  // The scene in the pose shown last.
  const Scene& scene() const { return scene_; }

  // The pose at a time. Any thread may call it, also concurrently. Errors: those of pose_at().
  Status find_pose(double time_s, Pose& out) const;
  // The vertices of a pose, from any thread. Errors: those of skin_vertices().
  Status skin(const Pose& pose, FrameVertices& out) const;
  // The vertices at a time: both steps. Errors: those of scene_at().
  Status skin(double time_s, FrameVertices& out) const;
  // Swaps the scene's vertices with these.
  void show(FrameVertices& vertices) { swap_vertices(vertices, scene_); }
  // The scene and the pose that will move its vertices, or has moved them. Must not outlive the
  // pose.
  PosedScene posed(const Pose& pose, bool is_moved) {
    return {&animated_->skin, &pose, &scene_, is_moved};
  }

  // Union of the boxes of the transformed vertices at all times, each as a request for it alone
  // would find it. Shows the last time. `check` runs between times. Errors: those of `check` and of
  // skin().
  Result<Box3d> box_over(std::span<const double> times_s, const glm::dmat4& world_from_file,
                         const std::function<Status()>& check);

 private:
  MovingScene(std::shared_ptr<const AnimatedScene> animated, size_t animation, bool strips)
      : animated_(std::move(animated)),
        animation_(animation),
        strips_(strips),
        scene_(animated_->scene) {}

  std::shared_ptr<const AnimatedScene> animated_;
  size_t animation_;
  bool strips_;
  glm::dvec3 first_root_{0.0};
  int up_axis_ = 1;
  Scene scene_;
};

}  // namespace voxeld
