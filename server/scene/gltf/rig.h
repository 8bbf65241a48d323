// A rig made of the node tree of a glTF document.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/animation.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// Morph weights of all nodes that show a mesh, 32 MiB of doubles in every pose. More:
// malformed-mesh. A few bytes of a file can give many nodes a mesh with many empty targets.
inline constexpr size_t kMorphWeightsMax = size_t{1} << 22;

// The matrices and weights that vertices follow: one matrix per joint of each skin in use, and one
// per node whose mesh has vertices without a skin.
struct Bindings {
  // A matrix of the pose: world_from_node * node_from_bound.
  struct Bound {
    uint32_t node = 0;
    glm::dmat4 node_from_bound{1.0};  // inverse bind matrix of a joint
  };
  struct Weights {
    uint32_t first = 0;
    size_t count = 0;
  };
  std::vector<Bound> bound;
  std::vector<double> morph_weights;            // at rest
  std::map<uint32_t, Weights> weights_of_node;  // in morph_weights
};

// Makes the matrices that vertices follow while meshes are loaded, in the pose in which the file
// leaves its nodes, and records the vertices' bindings for a rig. One per load; the objects it
// refers to must outlive it.
class RigBuilder {
 public:
  // `is_recorded`: the scene is animated; otherwise there is no part() and no finish().
  RigBuilder(const Document& document, Accessors& accessors, bool is_recorded)
      : document_(document), accessors_(accessors), is_recorded_(is_recorded) {}

  bool is_recorded() const { return is_recorded_; }
  // Index of the matrix of a node without skin, or of the first joint of a skin; made on first use.
  // Errors: malformed-mesh, for the inverse bind matrices of a skin.
  uint32_t matrix_of_node(int node);
  Result<uint32_t> first_matrix_of_skin(int skin);
  // Index of the matrix of the first copy of a node's mesh; those of the others follow. To be
  // called once for a node. Errors: malformed-mesh for more than kInstancesMax copies in the file.
  Result<uint32_t> first_matrix_of_instances(int node,
                                             std::span<const glm::dmat4> node_from_instance);
  const glm::dmat4& world_from_bound(uint32_t matrix) const { return world_from_bound_[matrix]; }
  // Index of the first of `count` weights of a node's mesh. They begin with `weights`, followed by
  // zeros. Errors: malformed-mesh for more than kMorphWeightsMax.
  Result<uint32_t> first_weight_of_node(int node, const std::vector<double>& weights, size_t count);
  // The table for the vertices of one part of the scene.
  SkinPart& part(size_t index);
  // Closes a vertex. Errors: malformed-mesh for more influences or morphs than kSkinInfluencesMax.
  Status end_vertex(SkinPart& part);

  // Completes `animated`, which has its scene already. Errors: those of read_animations().
  Status finish(AnimatedScene& animated);

 private:
  void add_matrix(int node, const glm::dmat4& node_from_bound);
  std::vector<bool> is_joint_of(std::span<const int> skins) const;
  void add_joints(AnimatedScene& animated) const;
  uint32_t root_of(const Animation* animation) const;

  const Document& document_;
  Accessors& accessors_;
  bool is_recorded_;
  Bindings bindings_;
  std::vector<glm::dmat4> world_from_bound_;  // of bindings_.bound
  std::vector<SkinPart> parts_;
  std::map<int, uint32_t> node_matrices_, skin_matrices_;
  std::vector<int> skins_;  // in the order of their first use
  int64_t influence_count_ = 0, morph_count_ = 0;
  size_t instance_count_ = 0;
};

}  // namespace voxeld::gltf
