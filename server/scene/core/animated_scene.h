// An animated scene: the bind pose, the rig that moves it, and the vertices at time t. The format
// may be MD5 or glTF.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/core/skin_table.h"

namespace voxeld {

struct AnimationInfo {
  std::string name;  // MD5: the file's name without folder and extension; "animation N" if there is
                     // none
  int64_t frame_count = 0;  // MD5 only; 0: keys have times of their own (glTF)
  double frame_rate = 0.0;  // frames per second; 0 if frame_count is 0
  // Seconds from time 0 to the last frame or key. In a cycle, the last frame equals the first of
  // the next round.
  double duration_s = 0.0;
  // The reason if the animation is unusable: broken, or it does not fit the mesh. The numbers are
  // then 0.
  std::optional<Error> unusable = std::nullopt;
};

struct SceneJoint {
  std::string name;
  int parent = -1;  // index of a joint; -1: a root
};

// The rig that moves a scene. Immutable, so threads may share it.
class Rig {
 public:
  virtual ~Rig() = default;
  // The pose in which the file leaves its joints, as in AnimatedScene::scene.
  virtual Pose rest() const = 0;
  // The pose of a usable animation at 0 <= seconds <= its duration.
  virtual Pose at(size_t animation, double seconds) const = 0;
};

struct AnimatedScene {
  // The scene as load_scene() returns it. Topology, texture coordinates, colours and materials hold
  // for all times. So does the order of a triangle's corners, even if a scale turns negative later.
  Scene scene;
  std::vector<SceneJoint> joints;  // joints that vertices may follow
  std::vector<AnimationInfo> animations;
  SkinTable skin;
  std::shared_ptr<const Rig> rig;  // null: a format without joints
};

// Index of the animation with this name (the first of several), else with this number, from 0.
// Errors: invalid-option listing the names; the reason of an unusable one.
Result<size_t> find_animation(const AnimatedScene& animated, std::string_view name_or_index);
// The first usable animation. Errors: invalid-option if there is none at all; the reason of the
// first if none is usable.
Result<size_t> default_animation(const AnimatedScene& animated);

// The meaning of times outside 0..duration: clamped to the ends, or repeated.
enum class Repeat { kClamp, kLoop };
// kStrip keeps the root joint over its place in the first of the sampled frames. The whole scene
// moves with it, along x and z only, because y is up.
//
// The root joint is the first joint without a parent (MD5) or the topmost joint of the first skin
// (glTF). If nothing is skinned, it is the topmost node that the animation translates.
enum class RootMotion { kKeep, kStrip };

// The pose of an animation at a time in seconds; NaN counts as 0. Errors: invalid-option for an
// absent animation; the reason of an unusable one.
Result<Pose> pose_at(const AnimatedScene& animated, size_t animation, double seconds,
                     Repeat repeat = Repeat::kClamp);

// Moves a pose so that its root joint stands over `first_root`, the root of another pose. up_axis:
// of the file, 1 or 2.
void strip_root_motion(Pose& pose, const glm::dvec3& first_root, int up_axis);

// Combines pose_at() and skin_vertices(). Errors: those of both.
Result<FrameVertices> scene_at(const AnimatedScene& animated, size_t animation, double seconds,
                               Repeat repeat = Repeat::kClamp);

// Swaps positions and normals of the parts with those of a frame of the same scene, without
// copying. Triangles, materials and images stay.
void swap_vertices(FrameVertices& frame, Scene& scene);

// Union of the boxes at all `times_s`: the one placement in which frames align. With kStrip the
// others move to the first time. Empty if there are no times. Errors: those of scene_at().
Result<Box3d> bounds_over(const AnimatedScene& animated, size_t animation,
                          std::span<const double> times_s, RootMotion root_motion,
                          Repeat repeat = Repeat::kClamp);

}  // namespace voxeld
