// A scene that moves: the bind pose, what moves it, and where its vertices are at time t. Serves
// MD5 and glTF alike.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/load.h"
#include "server/scene/scene.h"
#include "server/scene/skin_table.h"

namespace voxeld {

struct AnimationInfo {
  std::string name;  // of MD5: the file's, without folder and extension; "animation N" for none
  int64_t frame_count = 0;  // of MD5; 0: keys at times of their own (glTF)
  double frame_rate = 0.0;  // frames per second; 0 where frame_count is
  // From time 0 to the last frame or key. The last frame of a cycle is the first of the next one.
  double duration_s = 0.0;
  // Why it cannot be used: it is broken, or does not fit the mesh. Its numbers are 0 then.
  std::optional<Error> unusable = std::nullopt;
};

struct SceneJoint {
  std::string name;
  int parent = -1;  // index of a joint; -1: a root
};

// What moves a scene. Immutable; threads may share it.
class Rig {
 public:
  virtual ~Rig() = default;
  // The pose in which the file leaves its joints: that of AnimatedScene::scene.
  virtual Pose rest() const = 0;
  // An animation that can be used; 0 <= seconds <= its duration.
  virtual Pose at(size_t animation, double seconds) const = 0;
};

struct AnimatedScene {
  // As load_scene() gives it. Topology, texture coordinates, colours and materials are those of all
  // times; so is the order of the corners of triangles, also where a scale turns negative later.
  Scene scene;
  std::vector<SceneJoint> joints;  // that vertices may follow
  std::vector<AnimationInfo> animations;
  SkinTable skin;
  std::shared_ptr<const Rig> rig;  // null: a format without joints
};

// The whole way, as load_scene(). A zip's md5anim files all belong to its md5mesh, in the order of
// the zip. Each stands for itself: one that is broken or does not fit is listed as unusable, with
// the warning "ignored-animation". Errors: those of load_scene(); malformed-mesh for an animation
// of a glTF document that is broken, naming its place there.
Result<AnimatedScene> load_animated_scene(std::string_view filename, std::span<const uint8_t> bytes,
                                          const LoadOptions& options = {});

Result<AnimatedScene> load_animated_scene(std::string_view filename, const Bundle& bundle,
                                          const LoadOptions& options = {});

// One loader per format, as in load.h.
Result<AnimatedScene> load_animated_md5(std::string_view name, std::span<const uint8_t> bytes,
                                        const Bundle& bundle, const LoadOptions& options);
Result<AnimatedScene> load_animated_gltf(std::string_view name, std::span<const uint8_t> bytes,
                                         const Bundle& bundle, const LoadOptions& options);

// Index of the animation with this name (the first of several), else with this number, from 0.
// Errors: invalid-option listing the names; the reason of one that cannot be used.
Result<size_t> find_animation(const AnimatedScene& animated, std::string_view name_or_index);
// The first animation that can be used. Errors: invalid-option where there is none at all; the
// reason of the first where none can be used.
Result<size_t> default_animation(const AnimatedScene& animated);

// What times outside of 0..duration mean: its ends, or further rounds.
enum class Repeat { kClamp, kLoop };
// kStrip: the root joint stays over the place that it has in the first of the sampled frames. It is
// the first joint without a parent (MD5), the topmost joint of the first skin, or, where nothing is
// skinned, the topmost node that the animation translates (glTF). The whole scene moves with it,
// along x and z alone: up is y.
enum class RootMotion { kKeep, kStrip };

// The pose of an animation at a time in seconds; NaN is taken as 0. Errors: invalid-option for an
// animation that is not there; the reason of one that cannot be used.
Result<Pose> pose_at(const AnimatedScene& animated, size_t animation, double seconds,
                     Repeat repeat = Repeat::kClamp);

// Moves a pose so that its root joint stands over `first_root`, the root of another.
void strip_root_motion(Pose& pose, const glm::dvec3& first_root);

// pose_at() and skin_vertices() in one. Errors: those of both.
Result<FrameVertices> scene_at(const AnimatedScene& animated, size_t animation, double seconds,
                               Repeat repeat = Repeat::kClamp);

// Exchanges positions and normals of the parts with those of a frame of the same scene; nothing is
// copied. Triangles, materials and images stay.
void swap_vertices(FrameVertices& frame, Scene& scene);

// Union of the boxes at all `times_s`: one placement in which frames align. With kStrip the first
// time is the one that the others are moved to. Empty for no times. Errors: those of scene_at().
Result<Box3d> bounds_over(const AnimatedScene& animated, size_t animation,
                          std::span<const double> times_s, RootMotion root_motion,
                          Repeat repeat = Repeat::kClamp);

}  // namespace voxeld
