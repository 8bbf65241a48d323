#include "server/scene/core/animated_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/text/number_text.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

constexpr size_t kListedAnimationsMax = 20;

std::string listed(const std::vector<AnimationInfo>& animations) {
  std::string text;
  for (size_t i = 0; i < animations.size() && i < kListedAnimationsMax; ++i) {
    text += (i == 0 ? "" : ", ") + shown(animations[i].name);
  }
  if (animations.size() > kListedAnimationsMax) {
    text += " and " + std::to_string(animations.size() - kListedAnimationsMax) + " more";
  }
  return text;
}

Error no_animation(const AnimatedScene& animated, std::string got) {
  const size_t count = animated.animations.size();
  if (count == 0) {
    return {ErrorCode::kInvalidOption, "animation: the file has no animations", "", std::move(got)};
  }
  return {ErrorCode::kInvalidOption, "animation: there is none of this name or number",
          listed(animated.animations) + ", or " + index_text(count, "animations"), std::move(got)};
}

Result<size_t> checked(const AnimatedScene& animated, size_t index) {
  if (animated.animations[index].unusable) return *animated.animations[index].unusable;
  return index;
}

double time_in(double duration_s, double seconds, Repeat repeat) {
  if (std::isnan(seconds) || duration_s <= 0.0) return 0.0;
  if (repeat == Repeat::kLoop && std::isfinite(seconds)) {
    const double rest = std::fmod(seconds, duration_s);
    seconds = rest < 0.0 ? rest + duration_s : rest;
  }
  return std::clamp(seconds, 0.0, duration_s);
}

void add_used(Box3d& box, const Scene& scene, const FrameVertices& frame) {
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    for (const uint32_t index : scene.parts[p].indices) box.add(frame.parts[p].positions[index]);
  }
}

}  // namespace

Result<size_t> find_animation(const AnimatedScene& animated, std::string_view name_or_index) {
  const std::vector<AnimationInfo>& all = animated.animations;
  const auto found = std::find_if(all.begin(), all.end(), [&](const AnimationInfo& animation) {
    return animation.name == name_or_index;
  });
  if (found != all.end()) return checked(animated, static_cast<size_t>(found - all.begin()));
  const auto number = parse_integer(name_or_index);
  if (number && *number >= 0 && *number < static_cast<int64_t>(all.size())) {
    return checked(animated, static_cast<size_t>(*number));
  }
  return no_animation(animated, name_or_index.empty() ? "\"\"" : shown(name_or_index));
}

Result<size_t> default_animation(const AnimatedScene& animated) {
  const std::vector<AnimationInfo>& all = animated.animations;
  if (all.empty()) return no_animation(animated, "");
  const auto found = std::find_if(
      all.begin(), all.end(), [](const AnimationInfo& animation) { return !animation.unusable; });
  return checked(animated, found == all.end() ? 0 : static_cast<size_t>(found - all.begin()));
}

Result<Pose> pose_at(const AnimatedScene& animated, size_t animation, double seconds,
                     Repeat repeat) {
  if (!animated.rig || animation >= animated.animations.size()) {
    return no_animation(animated, std::to_string(animation));
  }
  VOXELD_TRY(checked(animated, animation));
  return animated.rig->at(animation,
                          time_in(animated.animations[animation].duration_s, seconds, repeat));
}

void strip_root_motion(Pose& pose, const glm::dvec3& first_root, int up_axis) {
  glm::dvec3 back = first_root - pose.root;
  back[up_axis] = 0;
  for (glm::dmat4& matrix : pose.world_from_bound) matrix[3] += glm::dvec4(back, 0.0);
  pose.root += back;
}

Result<FrameVertices> scene_at(const AnimatedScene& animated, size_t animation, double seconds,
                               Repeat repeat) {
  VOXELD_ASSIGN(const Pose pose, pose_at(animated, animation, seconds, repeat));
  FrameVertices frame;
  VOXELD_TRY(skin_vertices(animated.skin, animated.scene, pose, frame));
  return frame;
}

void swap_vertices(FrameVertices& frame, Scene& scene) {
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    std::swap(scene.parts[p].positions, frame.parts[p].positions);
    std::swap(scene.parts[p].normals, frame.parts[p].normals);
  }
}

Result<Box3d> bounds_over(const AnimatedScene& animated, size_t animation,
                          std::span<const double> times_s, RootMotion root_motion, Repeat repeat) {
  Box3d box;
  FrameVertices frame;
  glm::dvec3 first_root(0.0);
  for (size_t i = 0; i < times_s.size(); ++i) {
    VOXELD_ASSIGN(Pose pose, pose_at(animated, animation, times_s[i], repeat));
    if (i == 0) first_root = pose.root;
    if (root_motion == RootMotion::kStrip) strip_root_motion(pose, first_root, 1);
    VOXELD_TRY(skin_vertices(animated.skin, animated.scene, pose, frame));
    add_used(box, animated.scene, frame);
  }
  return box;
}

}  // namespace voxeld
