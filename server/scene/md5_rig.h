// MD5 joints and animations as what moves a scene.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/scene/animated_scene.h"
#include "server/scene/md5_anim.h"
#include "server/scene/md5_mesh.h"

namespace voxeld {

// A matrix per joint of the mesh takes points of the joint into the world (+y up).
class Md5Rig final : public Rig {
 public:
  struct Clip {
    Md5Anim anim;
    std::vector<uint32_t> anim_joints;  // per joint of the mesh; match_md5_joints()
  };
  explicit Md5Rig(std::vector<Md5Joint> joints) : joints_(std::move(joints)) {}
  // The next animation; an empty clip for one that cannot be used.
  void add(Clip clip) { clips_.push_back(std::move(clip)); }
  const std::vector<Md5Joint>& joints() const { return joints_; }

  Pose rest() const override;
  Pose at(size_t animation, double seconds) const override;

 private:
  std::vector<Md5Joint> joints_;
  std::vector<Clip> clips_;
};

// A point and a normal per weight, in its joint. Biases count as the file has them, as in the game:
// `uneven_count` is that of the vertices where they do not add up to 1. Errors: malformed-mesh for
// more than kSkinInfluencesMax.
Result<SkinTable> md5_skin_table(std::string_view name, const Md5Mesh& mesh, int64_t& uneven_count);

}  // namespace voxeld
