// A rig made of MD5 joints and animations.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/scene/core/animated_scene.h"
#include "server/scene/md5/animation.h"
#include "server/scene/md5/mesh.h"

namespace voxeld {

// Gives one matrix per joint of the mesh, which takes points of the joint into the world (+y up).
class Md5Rig final : public Rig {
 public:
  struct Clip {
    Md5Anim anim;
    std::vector<uint32_t> anim_joints;  // per joint of the mesh; match_md5_joints()
  };
  explicit Md5Rig(std::vector<Md5Joint> joints) : joints_(std::move(joints)) {}
  // Adds the next animation; an empty clip stands for an unusable one.
  void add(Clip clip) { clips_.push_back(std::move(clip)); }
  const std::vector<Md5Joint>& joints() const { return joints_; }

  Pose rest() const override;
  Pose at(size_t animation, double seconds) const override;

 private:
  std::vector<Md5Joint> joints_;
  std::vector<Clip> clips_;
};

// The skin table: a point and a normal per weight, in its joint. Biases are used as in the file, as
// the game does. `uneven_count` receives the number of vertices whose biases do not add up to 1.
// Errors: malformed-mesh for more than kSkinInfluencesMax.
Result<SkinTable> md5_skin_table(std::string_view name, const Md5Mesh& mesh, int64_t& uneven_count);

}  // namespace voxeld
