// An asset's scene while its vertices go through the frames of an animation.
//
// Vertices are skinned by the CPU, in doubles, whatever device voxelizes: every pipeline then snaps
// the same numbers, and frames are equal on all of them to the bit. It is also cheap: Bob with lamp
// (875 vertices, 33 joints) takes some 70 microseconds of one core, less than a hundredth of what
// the voxels take at 128^3, and runs beside them.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include <glm/mat4x4.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/scene/animated_scene.h"

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
  // The vertices at a time. From any thread, also beside the others. Errors: those of scene_at().
  Status skin(double time_s, FrameVertices& out) const;
  // Exchanges the scene's vertices with those.
  void show(FrameVertices& vertices) { swap_vertices(vertices, scene_); }

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
