#include "server/worker/frames/moving_scene.h"

#include "server/voxel/triangles/snap.h"

namespace voxeld {

Result<MovingScene> MovingScene::open(std::shared_ptr<const AnimatedScene> animated,
                                      const AnimationOptions& options, UpAxis up) {
  if (animated->animations.empty()) {
    return Error{ErrorCode::kInvalidOption, "animation: this asset has none",
                 "an asset with animations", animated->scene.format};
  }
  VOXELD_ASSIGN(const size_t index, options.animation
                                        ? find_animation(*animated, *options.animation)
                                        : default_animation(*animated));
  VOXELD_ASSIGN(const Pose first, pose_at(*animated, index, 0.0));
  MovingScene moving(std::move(animated), index, options.root_motion == RootMotionChoice::kStrip);
  moving.first_root_ = first.root;
  moving.up_axis_ = up == UpAxis::kZ ? 2 : 1;
  return moving;
}

Status MovingScene::find_pose(double time_s, Pose& out) const {
  VOXELD_ASSIGN(out, pose_at(*animated_, animation_, time_s));
  if (strips_) strip_root_motion(out, first_root_, up_axis_);
  return {};
}

Status MovingScene::skin(const Pose& pose, FrameVertices& out) const {
  return skin_vertices(animated_->skin, animated_->scene, pose, out);
}

Status MovingScene::skin(double time_s, FrameVertices& out) const {
  Pose pose;
  VOXELD_TRY(find_pose(time_s, pose));
  return skin(pose, out);
}

Result<Box3d> MovingScene::box_over(std::span<const double> times_s,
                                    const glm::dmat4& world_from_file,
                                    const std::function<Status()>& check) {
  Box3d box;
  FrameVertices vertices;
  for (const double time_s : times_s) {
    VOXELD_TRY(check());
    VOXELD_TRY(skin(time_s, vertices));
    show(vertices);
    const Box3d one = world_bounds(scene_, world_from_file);
    if (one.empty()) continue;
    box.add(one.min);
    box.add(one.max);
  }
  return box;
}

}  // namespace voxeld
