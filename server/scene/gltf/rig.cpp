#include "server/scene/gltf/rig.h"

#include <algorithm>
#include <array>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "server/scene/mesh_error.h"

namespace voxeld::gltf {
namespace {

struct RigParts {
  std::vector<Node> nodes;
  NodeTree tree;
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
    for (const int node : parts_.tree.order) {
      const auto at = static_cast<size_t>(node);
      const int parent = parts_.tree.parents[at];
      if (parent < 0) continue;
      world_from_node[at] = world_from_node[static_cast<size_t>(parent)] * parent_from_node[at];
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

uint32_t RigBuilder::matrix_of_node(int node) {
  const auto next = static_cast<uint32_t>(bindings_.bound.size());
  const auto [found, is_new] = node_matrices_.try_emplace(node, next);
  if (is_new) bindings_.bound.push_back({.node = static_cast<uint32_t>(node)});
  return found->second;
}

uint32_t RigBuilder::first_matrix_of_skin(int skin, const std::vector<glm::dmat4>& inverse_bind) {
  const auto next = static_cast<uint32_t>(bindings_.bound.size());
  const auto [found, is_new] = skin_matrices_.try_emplace(skin, next);
  if (!is_new) return found->second;
  skins_.push_back(skin);
  const std::vector<int>& joints = document_.skins[static_cast<size_t>(skin)].joints;
  for (size_t j = 0; j < joints.size(); ++j) {
    bindings_.bound.push_back({static_cast<uint32_t>(joints[j]),
                               inverse_bind.empty() ? glm::dmat4(1.0) : inverse_bind[j]});
  }
  return found->second;
}

uint32_t RigBuilder::first_weight_of_node(int node, const std::vector<double>& weights,
                                          size_t count) {
  std::vector<double>& all = bindings_.morph_weights;
  const Bindings::Weights next{static_cast<uint32_t>(all.size()), count};
  const auto [found, is_new] =
      bindings_.weights_of_node.try_emplace(static_cast<uint32_t>(node), next);
  if (is_new) {
    all.resize(all.size() + count);
    std::copy_n(weights.begin(), std::min(count, weights.size()), all.begin() + next.first);
  }
  return found->second.first;
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

// Adds the joints of the skins that vertices follow, in the order of the tree. A joint's parent is
// the next joint above it.
void RigBuilder::add_joints(AnimatedScene& animated) const {
  std::vector<bool> is_joint(document_.nodes.size());
  for (const int skin : skins_) {
    for (const int node : document_.skins[static_cast<size_t>(skin)].joints) {
      is_joint[static_cast<size_t>(node)] = true;
    }
  }
  std::vector<int> joint_above(document_.nodes.size(), -1);  // or the node itself
  for (const int node : tree_.order) {
    const auto at = static_cast<size_t>(node);
    const int parent = tree_.parents[at];
    const int above = parent < 0 ? -1 : joint_above[static_cast<size_t>(parent)];
    joint_above[at] = above;
    if (!is_joint[at]) continue;
    joint_above[at] = static_cast<int>(animated.joints.size());
    const std::string& name = document_.nodes[at].name;
    animated.joints.push_back({name.empty() ? "node " + std::to_string(node) : name, above});
  }
}

// The topmost joint of the first skin, or the topmost node that the animation translates. Else the
// first node, which always exists, because the scene shows a mesh.
uint32_t RigBuilder::root_of(const Animation* animation) const {
  std::vector<bool> is_candidate(document_.nodes.size());
  if (!skins_.empty()) {
    for (const int node : document_.skins[static_cast<size_t>(skins_[0])].joints) {
      is_candidate[static_cast<size_t>(node)] = true;
    }
  } else if (animation != nullptr) {
    for (const Channel& channel : animation->channels) {
      if (channel.property == Property::kTranslation) is_candidate[channel.node] = true;
    }
  }
  const auto found = std::find_if(tree_.order.begin(), tree_.order.end(), [&](int node) {
    return is_candidate[static_cast<size_t>(node)];
  });
  return static_cast<uint32_t>(found != tree_.order.end() ? *found : tree_.order.at(0));
}

Status RigBuilder::finish(Accessors& accessors, AnimatedScene& animated) {
  const auto morph_target_count = [&](uint32_t node) {
    const auto found = bindings_.weights_of_node.find(node);
    return found == bindings_.weights_of_node.end() ? size_t{0} : found->second.count;
  };
  RigParts rig;
  rig.nodes = document_.nodes;
  rig.tree = tree_;
  VOXELD_ASSIGN(rig.animations,
                read_animations(document_, accessors, morph_target_count, animated.scene));
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
