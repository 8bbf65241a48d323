// A rig made of the node tree of a glTF document.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/animated_scene.h"
#include "server/scene/gltf/animation.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/nodes.h"

namespace voxeld {

// Nodes, their animations, and the matrices and weights that vertices follow.
struct GltfRigParts {
  // A matrix of the pose: world_from_node * node_from_bound.
  struct Bound {
    uint32_t node = 0;
    glm::dmat4 node_from_bound{1.0};  // inverse bind matrix of a joint
  };
  std::vector<GltfNode> nodes;
  std::vector<int> parents, order;  // GltfNodes
  std::vector<Bound> bound;
  std::vector<double> morph_weights;                // at rest
  std::map<uint32_t, uint32_t> first_morph_weight;  // by node
  std::vector<GltfAnimation> animations;
  std::vector<uint32_t> roots;  // per animation, and last for the rest pose: the node of the root
                                // joint
};

// Gives one matrix per joint of each skin in use, and one per node whose mesh has vertices without
// a skin.
class GltfRig final : public Rig {
 public:
  explicit GltfRig(GltfRigParts parts);
  Pose rest() const override;
  Pose at(size_t animation, double seconds) const override;

 private:
  // `parent_from_node`: of every node, animated or not.
  Pose pose_of(const std::vector<glm::dmat4>& parent_from_node, uint32_t root) const;
  GltfRigParts parts_;
  std::vector<glm::dmat4> rest_parent_from_node_;
};

// Records the vertices' bindings while meshes are loaded. One per load; the objects it refers to
// must outlive it.
class GltfRigBuilder {
 public:
  GltfRigBuilder(std::string_view name, const GltfDocument& document, const GltfNodes& nodes)
      : name_(name), document_(document), nodes_(nodes) {}

  // Index of the matrix of a node without skin, or of the first joint of a skin; made on first use.
  uint32_t matrix_of_node(int node);
  uint32_t first_matrix_of_skin(int skin, const std::vector<glm::dmat4>& inverse_bind);
  // Index of the first of `count` weights of a node's mesh. They begin with `weights`, followed by
  // zeros.
  uint32_t first_weight_of_node(int node, const std::vector<double>& weights, size_t count);
  // The table for the vertices of one part of the scene.
  SkinPart& part(size_t index);
  // Closes a vertex. Errors: malformed-mesh for more influences or morphs than kSkinInfluencesMax.
  Status end_vertex(SkinPart& part);

  // Completes `animated`, which has its scene already.
  Status finish(GltfAccessors& accessors, const nlohmann::json& animations,
                AnimatedScene& animated);

 private:
  void add_joints(AnimatedScene& animated) const;
  uint32_t root_of(const GltfAnimation* animation) const;

  std::string_view name_;
  const GltfDocument& document_;
  const GltfNodes& nodes_;
  GltfRigParts rig_;
  std::vector<SkinPart> parts_;
  std::map<int, uint32_t> node_matrices_, skin_matrices_;
  std::map<uint32_t, size_t> weight_counts_;  // by node
  std::vector<int> skins_;                    // in the order of their first use
  int64_t influence_count_ = 0, morph_count_ = 0;
};

}  // namespace voxeld
