// The assertion of every fuzz target of animations: an error with a message, or frames that the
// voxelizer can use without checks.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <string_view>

#include "server/base/check.h"
#include "server/scene/describe_asset.h"
#include "server/scene/load.h"
#include "tests/fuzz/scene_fuzz.h"

namespace voxeld::fuzz {

inline void check_error(const Error& error) {
  VOXELD_CHECK(!error.detail.empty(), "an error says what");
  VOXELD_CHECK(error.code != ErrorCode::kInternal, "input is never an internal error");
}

inline void check_skin(const AnimatedScene& animated) {
  const SkinTable& skin = animated.skin;
  VOXELD_CHECK(skin.vertex_count() == animated.scene.vertex_count(), "every vertex follows");
  const size_t matrices = animated.rig->rest().world_from_bound.size();
  for (const Influence& influence : skin.influences) {
    VOXELD_CHECK(influence.matrix < matrices, "matrix in range");
  }
}

inline void check_frames(AnimatedScene& animated, size_t animation) {
  const double duration = animated.animations[animation].duration_s;
  VOXELD_CHECK(std::isfinite(duration) && duration >= 0.0, "finite duration");
  for (const double share : {0.0, 0.37, 1.0}) {
    auto frame = scene_at(animated, animation, share * duration);
    if (!frame) {
      check_error(frame.error());
      continue;
    }
    swap_vertices(*frame, animated.scene);
    for (const MeshPart& part : animated.scene.parts) {
      check_part(animated.scene, part);
      for (const glm::vec3& n : part.normals) {
        VOXELD_CHECK(std::abs(glm::length(n) - 1.0f) < 1e-3f, "normals of length 1");
      }
    }
  }
}

inline int load_animated(std::string_view filename, std::span<const uint8_t> bytes) {
  auto animated = load_animated_scene(filename, bytes, {.decode_images = false});
  if (!animated) {
    check_error(animated.error());
    return 0;
  }
  VOXELD_CHECK(describe_asset(*animated).meshes.size() == animated->scene.parts.size(),
               "a description of each mesh");
  if (!animated->rig) return 0;
  check_skin(*animated);
  constexpr size_t kAnimationsTried = 4;
  for (size_t a = 0; a < animated->animations.size() && a < kAnimationsTried; ++a) {
    check_frames(*animated, a);
  }
  return 0;
}

}  // namespace voxeld::fuzz
