// An asset's scene while its vertices go through the frames of an animation.
//
// Vertices are moved by a device, where it voxelizes them by pipeline compute in batches and its
// 64-bit floats are the CPU's (voxel/device_skin.h); else by the CPU, in doubles. Both have the
// same bits: every pipeline then snaps the same numbers, and frames are equal on all of them. The
// CPU does it beside the voxels of the frame before, in 70 microseconds of one core for Bob with
// lamp (875 vertices, 33 joints).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include <glm/mat4x4.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/scene/animated_scene.h"
#include "server/voxel/shared_frames.h"

namespace voxeld {

class MovingScene {
 public:
  // The animation that the options name, or the first one. Errors: invalid-option for an asset
  // without animations, and those of find_animation().
  static Result<MovingScene> open(std::shared_ptr<const AnimatedScene> animated,
                                  const AnimationOptions& options);

  const AnimationInfo& animation() const { return animated_->animations[animation_]; }
  size_t animation_index() const { return animation_; }
  // The pose in which the file leaves it. Not touched by what follows.
  const Scene& bind() const { return animated_->scene; }
  // As it was shown last.
  const Scene& scene() const { return scene_; }

  // Where root motion is stripped to: before the first skin(). Errors: those of pose_at().
  Status begin(double first_time_s);
  // What moves the vertices at a time. From any thread, also beside the others. Errors: those of
  // pose_at().
  Status find_pose(double time_s, Pose& out) const;
  // The vertices of a pose. From any thread. Errors: those of skin_vertices().
  Status skin(const Pose& pose, FrameVertices& out) const;
  // Both. Errors: those of scene_at().
  Status skin(double time_s, FrameVertices& out) const;
  // Exchanges the scene's vertices with those.
  void show(FrameVertices& vertices) { swap_vertices(vertices, scene_); }
  // The scene with what is to move its vertices, or has moved them. Must not outlive the pose.
  PosedScene posed(const Pose& pose, bool is_moved) {
    return {&animated_->skin, &pose, &scene_, is_moved};
  }

  // Union of the boxes of the transformed vertices at all times, as a request for each of them
  // would find it. Shows the last of them. check: between times. Errors: its; those of skin().
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
  Scene scene_;
};

}  // namespace voxeld
