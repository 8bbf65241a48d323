#include "server/scene/gltf/rig.h"

#include <algorithm>
#include <array>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

// Sets a property of the node, or its morph weights, at a time.
void apply(const GltfChannel& channel, double seconds, GltfTransform& transform,
           std::span<double> weights) {
  std::array<double, 4> value{};
  switch (channel.property) {
    case GltfProperty::kTranslation:
      sample_numbers(channel.keys, seconds, value);
      transform.translation = {value[0], value[1], value[2]};
      return;
    case GltfProperty::kRotation:
      sample_rotation(channel.keys, seconds, value);
      transform.rotation = glm::dquat(value[3], value[0], value[1], value[2]);
      return;
    case GltfProperty::kScale:
      sample_numbers(channel.keys, seconds, value);
      transform.scale = {value[0], value[1], value[2]};
      return;
    case GltfProperty::kWeights:
      sample_numbers(channel.keys, seconds, weights);
      return;
  }
}

}  // namespace

GltfRig::GltfRig(GltfRigParts parts) : parts_(std::move(parts)) {
  for (const GltfNode& node : parts_.nodes) {
    rest_parent_from_node_.push_back(node.parent_from_node);
  }
}

Pose GltfRig::pose_of(const std::vector<glm::dmat4>& parent_from_node, uint32_t root) const {
  std::vector<glm::dmat4> world_from_node = parent_from_node;
  for (const int node : parts_.order) {
    const auto at = static_cast<size_t>(node);
    if (parts_.parents[at] < 0) continue;
    const auto parent = static_cast<size_t>(parts_.parents[at]);
    world_from_node[at] = world_from_node[parent] * parent_from_node[at];
  }
  Pose pose;
  pose.world_from_bound.reserve(parts_.bound.size());
  for (const GltfRigParts::Bound& bound : parts_.bound) {
    pose.world_from_bound.push_back(world_from_node[bound.node] * bound.node_from_bound);
  }
  pose.morph_weights = parts_.morph_weights;
  pose.root = glm::dvec3(world_from_node[root][3]);
  return pose;
}

Pose GltfRig::rest() const {
  return pose_of(rest_parent_from_node_, parts_.roots.back());
}

Pose GltfRig::at(size_t animation, double seconds) const {
  std::map<uint32_t, GltfTransform> moved;
  std::vector<double> morph_weights = parts_.morph_weights;
  for (const GltfChannel& channel : parts_.animations.at(animation).channels) {
    if (channel.property == GltfProperty::kWeights) {
      const uint32_t first = parts_.first_morph_weight.at(channel.node);
      GltfTransform unused;
      apply(channel, seconds, unused, std::span(morph_weights).subspan(first, channel.keys.width));
      continue;
    }
    const auto node = moved.try_emplace(channel.node, parts_.nodes[channel.node].transform).first;
    apply(channel, seconds, node->second, {});
  }
  std::vector<glm::dmat4> parent_from_node = rest_parent_from_node_;
  for (const auto& [node, transform] : moved) parent_from_node[node] = transform.matrix();
  Pose pose = pose_of(parent_from_node, parts_.roots.at(animation));
  pose.morph_weights = std::move(morph_weights);
  return pose;
}

uint32_t GltfRigBuilder::matrix_of_node(int node) {
  const auto next = static_cast<uint32_t>(rig_.bound.size());
  const auto [found, is_new] = node_matrices_.try_emplace(node, next);
  if (is_new) rig_.bound.push_back({static_cast<uint32_t>(node), glm::dmat4(1.0)});
  return found->second;
}

uint32_t GltfRigBuilder::first_matrix_of_skin(int skin,
                                              const std::vector<glm::dmat4>& inverse_bind) {
  const auto next = static_cast<uint32_t>(rig_.bound.size());
  const auto [found, is_new] = skin_matrices_.try_emplace(skin, next);
  if (!is_new) return found->second;
  skins_.push_back(skin);
  const std::vector<int>& joints = document_.skins[static_cast<size_t>(skin)].joints;
  for (size_t j = 0; j < joints.size(); ++j) {
    rig_.bound.push_back({static_cast<uint32_t>(joints[j]),
                          inverse_bind.empty() ? glm::dmat4(1.0) : inverse_bind[j]});
  }
  return found->second;
}

uint32_t GltfRigBuilder::first_weight_of_node(int node_index, const std::vector<double>& weights,
                                              size_t count) {
  const auto node = static_cast<uint32_t>(node_index);
  const auto found = rig_.first_morph_weight.find(node);
  if (found != rig_.first_morph_weight.end()) return found->second;
  const auto first = static_cast<uint32_t>(rig_.morph_weights.size());
  for (size_t i = 0; i < count; ++i) {
    rig_.morph_weights.push_back(i < weights.size() ? weights[i] : 0.0);
  }
  rig_.first_morph_weight.emplace(node, first);
  weight_counts_.emplace(node, count);
  return first;
}

SkinPart& GltfRigBuilder::part(size_t index) {
  if (parts_.size() <= index) parts_.resize(index + 1);
  return parts_[index];
}

Status GltfRigBuilder::end_vertex(SkinPart& part) {
  const auto influences = static_cast<int64_t>(part.influences.size());
  const auto morphs = static_cast<int64_t>(part.morphs.size());
  influence_count_ += influences - (part.influence_ends.empty() ? 0 : part.influence_ends.back());
  morph_count_ += morphs - (part.morph_ends.empty() ? 0 : part.morph_ends.back());
  part.end_vertex();
  const int64_t count = std::max(influence_count_, morph_count_);
  if (count <= kSkinInfluencesMax) return {};
  return over_limit(name_, "", "joints, or morph targets, of all vertices", kSkinInfluencesMax,
                    count);
}

// Adds the joints of the skins that vertices follow, in the order of the tree. A joint's parent is
// the next joint above it.
void GltfRigBuilder::add_joints(AnimatedScene& animated) const {
  std::vector<bool> is_joint(document_.nodes.size());
  for (const int skin : skins_) {
    for (const int node : document_.skins[static_cast<size_t>(skin)].joints) {
      is_joint[static_cast<size_t>(node)] = true;
    }
  }
  std::vector<int> joint_above(document_.nodes.size(), -1);  // or the node itself
  for (const int node : nodes_.order) {
    const auto at = static_cast<size_t>(node);
    const int parent = nodes_.parents[at];
    const int above = parent < 0 ? -1 : joint_above[static_cast<size_t>(parent)];
    joint_above[at] = above;
    if (!is_joint[at]) continue;
    joint_above[at] = static_cast<int>(animated.joints.size());
    const std::string& name = document_.nodes[at].name;
    animated.joints.push_back({name.empty() ? "node " + std::to_string(node) : name, above});
  }
}

uint32_t GltfRigBuilder::root_of(const GltfAnimation* animation) const {
  std::vector<bool> is_candidate(document_.nodes.size());
  if (!skins_.empty()) {
    for (const int node : document_.skins[static_cast<size_t>(skins_[0])].joints) {
      is_candidate[static_cast<size_t>(node)] = true;
    }
  } else if (animation != nullptr) {
    for (const GltfChannel& channel : animation->channels) {
      if (channel.property == GltfProperty::kTranslation) is_candidate[channel.node] = true;
    }
  }
  const auto found = std::find_if(nodes_.order.begin(), nodes_.order.end(), [&](int node) {
    return is_candidate[static_cast<size_t>(node)];
  });
  // A node always exists, because the scene shows a mesh.
  return static_cast<uint32_t>(found != nodes_.order.end() ? *found : nodes_.order.at(0));
}

Status GltfRigBuilder::finish(GltfAccessors& accessors, const nlohmann::json& animations,
                              AnimatedScene& animated) {
  const auto morph_target_count = [&](uint32_t node) {
    const auto found = weight_counts_.find(node);
    return found == weight_counts_.end() ? size_t{0} : found->second;
  };
  VOXELD_ASSIGN(rig_.animations, read_gltf_animations(name_, animations, document_, accessors,
                                                      morph_target_count, animated.scene));
  for (const GltfAnimation& animation : rig_.animations) {
    animated.animations.push_back({.name = animation.name, .duration_s = animation.duration_s});
    rig_.roots.push_back(root_of(&animation));
  }
  rig_.roots.push_back(root_of(nullptr));
  add_joints(animated);
  parts_.resize(animated.scene.parts.size());
  animated.skin = join_skin_parts(std::move(parts_), false);
  rig_.nodes = document_.nodes;
  rig_.parents = nodes_.parents;
  rig_.order = nodes_.order;
  animated.rig = std::make_shared<GltfRig>(std::move(rig_));
  return {};
}

}  // namespace voxeld
