#include "server/scene/gltf/rig.h"

#include <algorithm>
#include <array>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/instances.h"

namespace voxeld::gltf {
namespace {

struct RigParts {
  std::vector<Node> nodes;
  std::vector<int> order;  // Document::order
  Bindings bindings;
  std::vector<Animation> animations;
  // The node of the root joint, per animation, and last for the rest pose.
  std::vector<uint32_t> roots;
};

class GltfRig final : public Rig {
 public:
  explicit GltfRig(RigParts parts) : parts_(std::move(parts)) {
    for (const Node& node : parts_.nodes) rest_parent_from_node_.push_back(node.parent_from_node);
  }

  Pose rest() const override { return pose_of(rest_parent_from_node_, parts_.roots.back()); }

  Pose at(size_t animation, double seconds) const override {
    std::map<uint32_t, Transform> moved;
    std::vector<double> morph_weights = parts_.bindings.morph_weights;
    for (const Channel& channel : parts_.animations.at(animation).channels) {
      if (channel.property == Property::kWeights) {
        const auto [first, count] = parts_.bindings.weights_of_node.at(channel.node);
        sample_numbers(channel.keys, seconds, std::span(morph_weights).subspan(first, count));
      } else {
        const auto& at_rest = parts_.nodes[channel.node].transform;
        move(channel, seconds, moved.try_emplace(channel.node, at_rest).first->second);
      }
    }
    std::vector<glm::dmat4> parent_from_node = rest_parent_from_node_;
    for (const auto& [node, transform] : moved) parent_from_node[node] = transform.matrix();
    Pose pose = pose_of(parent_from_node, parts_.roots.at(animation));
    pose.morph_weights = std::move(morph_weights);
    return pose;
  }

 private:
  // Sets a property of a node at a time.
  static void move(const Channel& channel, double seconds, Transform& transform) {
    std::array<double, 4> value{};
    if (channel.property == Property::kRotation) {
      sample_rotation(channel.keys, seconds, value);
      transform.rotation = glm::dquat(value[3], value[0], value[1], value[2]);
      return;
    }
    sample_numbers(channel.keys, seconds, value);
    auto& vector = channel.property == Property::kScale ? transform.scale : transform.translation;
    vector = {value[0], value[1], value[2]};
  }

  // `parent_from_node`: of every node, animated or not.
  Pose pose_of(const std::vector<glm::dmat4>& parent_from_node, uint32_t root) const {
    std::vector<glm::dmat4> world_from_node = parent_from_node;
    for (const int node : parts_.order) {
      const int parent = parts_.nodes[node].parent;
      if (parent >= 0) world_from_node[node] = world_from_node[parent] * parent_from_node[node];
    }
    Pose pose;
    pose.world_from_bound.reserve(parts_.bindings.bound.size());
    for (const auto& [node, node_from_bound] : parts_.bindings.bound) {
      pose.world_from_bound.push_back(world_from_node[node] * node_from_bound);
    }
    pose.morph_weights = parts_.bindings.morph_weights;
    pose.root = glm::dvec3(world_from_node[root][3]);
    return pose;
  }

  RigParts parts_;
  std::vector<glm::dmat4> rest_parent_from_node_;
};

}  // namespace

void RigBuilder::add_matrix(int node, const glm::dmat4& node_from_bound) {
  bindings_.bound.push_back({static_cast<uint32_t>(node), node_from_bound});
  world_from_bound_.push_back(document_.nodes[node].world_from_node * node_from_bound);
}

uint32_t RigBuilder::matrix_of_node(int node) {
  const auto next = static_cast<uint32_t>(bindings_.bound.size());
  const auto [found, is_new] = node_matrices_.try_emplace(node, next);
  if (is_new) add_matrix(node, glm::dmat4(1.0));
  return found->second;
}

Result<uint32_t> RigBuilder::first_matrix_of_skin(int index) {
  const auto next = static_cast<uint32_t>(bindings_.bound.size());
  const auto [found, is_new] = skin_matrices_.try_emplace(index, next);
  if (!is_new) return found->second;
  skins_.push_back(index);
  const Skin& skin = document_.skins[index];
  std::optional<Elements> inverse;
  if (skin.inverse_bind_matrices >= 0) {
    VOXELD_ASSIGN(inverse, accessors_.open(skin.inverse_bind_matrices,
                                           {"inverseBindMatrices", 16, 16, Expected::kFloat}));
    if (inverse->count < skin.joints.size()) {
      return document_.malformed(at_index("skins", index) + ".inverseBindMatrices", "elements",
                                 "at least " + std::to_string(skin.joints.size()),
                                 std::to_string(inverse->count));
    }
  }
  for (size_t j = 0; j < skin.joints.size(); ++j) {
    add_matrix(skin.joints[j], inverse ? inverse->matrix(j) : glm::dmat4(1.0));
  }
  return next;
}

Result<uint32_t> RigBuilder::first_matrix_of_instances(
    int node, std::span<const glm::dmat4> node_from_instance) {
  const auto next = static_cast<uint32_t>(bindings_.bound.size());
  instance_count_ += node_from_instance.size();
  if (instance_count_ > kInstancesMax) {
    return over_limit(document_.name, at_index("nodes", node), "copies of the meshes of all nodes",
                      kInstancesMax, static_cast<int64_t>(instance_count_));
  }
  for (const glm::dmat4& matrix : node_from_instance) add_matrix(node, matrix);
  return next;
}

Result<uint32_t> RigBuilder::first_weight_of_node(int node, const std::vector<double>& weights,
                                                  size_t count) {
  std::vector<double>& all = bindings_.morph_weights;
  const Bindings::Weights next{static_cast<uint32_t>(all.size()), count};
  const auto [found, is_new] =
      bindings_.weights_of_node.try_emplace(static_cast<uint32_t>(node), next);
  if (!is_new) return found->second.first;
  if (count > kMorphWeightsMax - all.size()) {
    return over_limit(document_.name, at_index("nodes", node), "morph weights of all nodes",
                      kMorphWeightsMax, static_cast<int64_t>(all.size() + count));
  }
  all.resize(all.size() + count);
  std::copy_n(weights.begin(), std::min(count, weights.size()), all.begin() + next.first);
  return next.first;
}

SkinPart& RigBuilder::part(size_t index) {
  if (parts_.size() <= index) parts_.resize(index + 1);
  return parts_[index];
}

Status RigBuilder::end_vertex(SkinPart& part) {
  const auto influences = static_cast<int64_t>(part.influences.size());
  const auto morphs = static_cast<int64_t>(part.morphs.size());
  influence_count_ += influences - (part.influence_ends.empty() ? 0 : part.influence_ends.back());
  morph_count_ += morphs - (part.morph_ends.empty() ? 0 : part.morph_ends.back());
  part.end_vertex();
  const int64_t count = std::max(influence_count_, morph_count_);
  if (count <= kSkinInfluencesMax) return {};
  return over_limit(document_.name, "", "joints, or morph targets, of all vertices",
                    kSkinInfluencesMax, count);
}

// Per node: whether it is a joint of one of the skins.
std::vector<bool> RigBuilder::is_joint_of(std::span<const int> skins) const {
  std::vector<bool> is_joint(document_.nodes.size());
  for (const int skin : skins) {
    for (const int node : document_.skins[skin].joints) is_joint[node] = true;
  }
  return is_joint;
}

// Adds the joints of the skins that vertices follow, in the order of the tree. A joint's parent is
// the next joint above it.
void RigBuilder::add_joints(AnimatedScene& animated) const {
  const std::vector<bool> is_joint = is_joint_of(skins_);
  std::vector<int> joint_above(document_.nodes.size(), -1);  // or the node itself
  for (const int at : document_.order) {
    const Node& node = document_.nodes[at];
    if (node.parent >= 0) joint_above[at] = joint_above[node.parent];
    if (!is_joint[at]) continue;
    const int joint = static_cast<int>(animated.joints.size());
    animated.joints.push_back(
        {node.name.empty() ? "node " + std::to_string(at) : node.name, joint_above[at]});
    joint_above[at] = joint;
  }
}

// The topmost joint of the first skin, or the topmost node that the animation translates. Else the
// first node, which always exists, because the scene shows a mesh.
uint32_t RigBuilder::root_of(const Animation* animation) const {
  std::vector<bool> is_candidate =
      is_joint_of(std::span(skins_).first(std::min(skins_.size(), size_t{1})));
  if (skins_.empty() && animation != nullptr) {
    for (const Channel& channel : animation->channels) {
      if (channel.property == Property::kTranslation) is_candidate[channel.node] = true;
    }
  }
  const auto& order = document_.order;
  const auto found =
      std::find_if(order.begin(), order.end(), [&](int node) { return is_candidate[node]; });
  return static_cast<uint32_t>(found != order.end() ? *found : order.at(0));
}

Status RigBuilder::finish(AnimatedScene& animated) {
  const auto morph_target_count = [&](uint32_t node) {
    const auto found = bindings_.weights_of_node.find(node);
    return found == bindings_.weights_of_node.end() ? size_t{0} : found->second.count;
  };
  RigParts rig;
  rig.nodes = document_.nodes;
  rig.order = document_.order;
  VOXELD_ASSIGN(rig.animations,
                read_animations(document_, accessors_, morph_target_count, animated.scene));
  for (const Animation& animation : rig.animations) {
    animated.animations.push_back({.name = animation.name, .duration_s = animation.duration_s});
    rig.roots.push_back(root_of(&animation));
  }
  rig.roots.push_back(root_of(nullptr));
  rig.bindings = std::move(bindings_);
  add_joints(animated);
  parts_.resize(animated.scene.parts.size());
  animated.skin = join_skin_parts(std::move(parts_), false);
  animated.rig = std::make_shared<GltfRig>(std::move(rig));
  return {};
}

}  // namespace voxeld::gltf
