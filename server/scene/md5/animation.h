// md5anim files (id Software's Doom 3) as plain data, and their poses.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/scene/md5/mesh.h"

namespace voxeld {

// Limits of one animation: frames, and numbers (frames times animated components).
inline constexpr int64_t kMd5FramesMax = 1'000'000;
inline constexpr int64_t kMd5NumbersMax = int64_t{1} << 28;
inline constexpr double kMd5FrameRate = 24.0;  // if the file has none

// A joint and its animated numbers. Bits 0 to 2 of `flags` are the position's x, y, z, bits 3 to 5
// the orientation's. A frame has the set ones in this order from first_component on; the base frame
// has the others.
struct Md5AnimJoint {
  std::string name;
  int parent = kMd5RootParent;  // < the joint's own index
  uint32_t flags = 0;
  uint32_t first_component = 0;
  glm::dvec3 base_position{0.0};     // in the parent
  glm::dvec3 base_orientation{0.0};  // x, y, z
};

struct Md5Anim {
  double frame_rate = kMd5FrameRate;  // frames per second
  std::vector<Md5AnimJoint> joints;
  uint32_t component_count = 0;  // numbers per frame
  size_t frame_count = 0;
  std::vector<float> components;  // frame by frame
  std::vector<Warning> warnings;

  // Seconds from the first frame to the last.
  double duration() const {
    return frame_count > 1 ? static_cast<double>(frame_count - 1) / frame_rate : 0.0;
  }
};

// Parses real files' grammar and the textbook's long keywords (numberOfFrames,
// numberOfAnimatedComponents). Frames may come in any order of their numbers. A missing or repeated
// frame is an error, as are components beyond a frame's. Errors: malformed-mesh with line, expected
// and got; unsupported-feature for versions other than 10.
Result<Md5Anim> parse_md5_anim(std::string_view name, std::string_view text);

// The pose of a joint, in its parent or in the model.
struct Md5Pose {
  glm::dvec3 position{0.0};
  glm::dquat orientation{1.0, 0.0, 0.0, 0.0};
};

// The joints in their parents at a time in seconds, clamped to 0..duration(). Between two frames,
// positions are interpolated linearly and orientations spherically (Shoemake 1985), the short way
// round. An orientation longer than a unit quaternion is normalized.
std::vector<Md5Pose> md5_local_pose(const Md5Anim& anim, double seconds);
// The pose in the model, from the pose in the parents.
std::vector<Md5Pose> md5_model_pose(const Md5Anim& anim, const std::vector<Md5Pose>& local);

// For each joint of the mesh, the animation's joint of the same name, whose parent must have the
// same name too; the order may differ. Errors: malformed-mesh, naming the joints that one of the
// two lacks, or whose parents differ.
Result<std::vector<uint32_t>> match_md5_joints(std::string_view mesh_name,
                                               const std::vector<Md5Joint>& mesh_joints,
                                               std::string_view anim_name, const Md5Anim& anim);

}  // namespace voxeld
