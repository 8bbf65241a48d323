#include "server/scene/gltf/vertex.h"

#include <algorithm>
#include <glm/matrix.hpp>

#include "proto/range_text.h"
#include "server/scene/color_space.h"
#include "server/scene/gltf/textures.h"
#include "server/scene/mesh_error.h"
#include "server/scene/normals.h"

namespace voxeld {
namespace {

// The number of morph targets: the most that any primitive of the mesh has. They should agree.
size_t target_count(const GltfDocument& document, int mesh) {
  size_t count = 0;
  for (const GltfPrimitive& primitive : document.meshes[static_cast<size_t>(mesh)].primitives) {
    count = std::max(count, primitive.targets.size());
  }
  return count;
}

bool is_point(const glm::dvec3& p) {
  return is_coordinate(p.x) && is_coordinate(p.y) && is_coordinate(p.z);
}

}  // namespace

Result<std::optional<GltfReader>> GltfVertices::open_attribute(
    const std::map<std::string, int>& attributes, const std::string& key, int components_min,
    int components_max, const GltfVertexSource& source) {
  using Opened = std::optional<GltfReader>;
  const auto found = attributes.find(key);
  if (found == attributes.end()) return Opened();
  VOXELD_ASSIGN(const GltfReader reader,
                accessors_.open(found->second, {key, components_min, components_max,
                                                GltfExpected::kFloatOrSmall}));
  if (reader.count() != source.position.count()) {
    return malformed_mesh(name_, source.path + "." + key, "elements of the attribute",
                          std::to_string(source.position.count()) + " as POSITION",
                          std::to_string(reader.count()));
  }
  return Opened(reader);
}

Result<GltfVertexSource> GltfVertices::open(int node_index, const GltfPrimitive& primitive,
                                            const std::string& path) {
  GltfVertexSource source;
  source.path = path;
  const auto position = primitive.attributes.find("POSITION");
  if (position == primitive.attributes.end()) {
    return malformed_mesh(name_, path + ".attributes.POSITION", "is missing", "an index",
                          "nothing");
  }
  VOXELD_ASSIGN(source.position,
                accessors_.open(position->second, {"POSITION", 3, 3, GltfExpected::kFloatOrSmall}));
  VOXELD_ASSIGN(source.normal, open_attribute(primitive.attributes, "NORMAL", 3, 3, source));
  VOXELD_ASSIGN(source.color, open_attribute(primitive.attributes, "COLOR_0", 3, 4, source));
  if (primitive.material >= 0) {
    const GltfMaterial& material = document_.materials[static_cast<size_t>(primitive.material)];
    if (material.texture >= 0) {
      const std::string key = "TEXCOORD_" + std::to_string(material.tex_coord);
      VOXELD_ASSIGN(source.uv, open_attribute(primitive.attributes, key, 2, 2, source));
      source.uv_transform = material.transform;
    }
  }
  const GltfNode& node = document_.nodes[static_cast<size_t>(node_index)];
  source.world_from_mesh = nodes_.world_from_node[static_cast<size_t>(node_index)];
  if (rig_ != nullptr) source.node_matrix = rig_->matrix_of_node(node_index);
  VOXELD_TRY(open_targets(node_index, primitive, source));
  if (node.skin >= 0) VOXELD_TRY(open_skin(node.skin, primitive, source));
  return source;
}

Status GltfVertices::open_targets(int node_index, const GltfPrimitive& primitive,
                                  GltfVertexSource& source) {
  const GltfNode& node = document_.nodes[static_cast<size_t>(node_index)];
  const std::vector<double>& weights =
      node.weights.empty() ? document_.meshes[static_cast<size_t>(node.mesh)].weights
                           : node.weights;
  if (rig_ != nullptr && !primitive.targets.empty()) {
    source.first_weight =
        rig_->first_weight_of_node(node_index, weights, target_count(document_, node.mesh));
  }
  for (size_t i = 0; i < primitive.targets.size(); ++i) {
    const double weight = i < weights.size() ? weights[i] : 0.0;
    if (weight == 0.0 && rig_ == nullptr) continue;
    GltfVertexSource::Target target{.number = i, .weight = weight, .position = {}, .normal = {}};
    VOXELD_ASSIGN(target.position, open_attribute(primitive.targets[i], "POSITION", 3, 3, source));
    VOXELD_ASSIGN(target.normal, open_attribute(primitive.targets[i], "NORMAL", 3, 3, source));
    source.targets.push_back(target);
  }
  return {};
}

// Opens the skin. Only its joints place a skinned mesh (glTF 2.0, 3.7.3.1), in the pose in which
// the file leaves its nodes.
Status GltfVertices::open_skin(int skin, const GltfPrimitive& primitive, GltfVertexSource& source) {
  for (int set = 0; set < GltfVertexJoints::kSetsMax; ++set) {
    const std::string number = std::to_string(set);
    VOXELD_ASSIGN(const auto joints,
                  open_attribute(primitive.attributes, "JOINTS_" + number, 4, 4, source));
    VOXELD_ASSIGN(const auto weights,
                  open_attribute(primitive.attributes, "WEIGHTS_" + number, 4, 4, source));
    if (!joints || !weights) break;
    source.influences.push_back({*joints, *weights});
  }
  if (source.influences.empty()) return {};  // not bound to any joint
  if (!world_from_bound_.contains(skin)) VOXELD_TRY(bind_joints(skin));
  source.world_from_bound = &world_from_bound_.at(skin);
  if (rig_ != nullptr) {
    source.first_joint_matrix = rig_->first_matrix_of_skin(skin, inverse_bind_[skin]);
  }
  return {};
}

Status GltfVertices::bind_joints(int index) {
  const GltfSkin& skin = document_.skins[static_cast<size_t>(index)];
  std::vector<glm::dmat4> matrices;
  for (const int joint : skin.joints) {
    matrices.push_back(nodes_.world_from_node[static_cast<size_t>(joint)]);
  }
  if (skin.inverse_bind_matrices >= 0) {
    VOXELD_ASSIGN(const GltfReader inverse,
                  accessors_.open(skin.inverse_bind_matrices,
                                  {"inverseBindMatrices", 16, 16, GltfExpected::kFloat}));
    if (inverse.count() < matrices.size()) {
      return malformed_mesh(name_, "skins[" + std::to_string(index) + "].inverseBindMatrices",
                            "elements", "at least " + std::to_string(matrices.size()),
                            std::to_string(inverse.count()));
    }
    std::vector<glm::dmat4>& inverse_bind = inverse_bind_[index];
    for (size_t i = 0; i < matrices.size(); ++i) {
      inverse_bind.push_back(inverse.matrix(i));
      matrices[i] = matrices[i] * inverse_bind.back();
    }
  }
  world_from_bound_.emplace(index, std::move(matrices));
  return {};
}

Result<GltfVertexJoints> GltfVertices::joints_of(const GltfVertexSource& source,
                                                 uint32_t index) const {
  GltfVertexJoints out;
  if (!source.world_from_bound) return out;
  const size_t joint_count = source.world_from_bound->size();
  for (const auto& [joints, weights] : source.influences) {
    const glm::dvec4 joint = joints.vector(index);
    const glm::dvec4 weight = weights.unit_vector(index);
    for (int i = 0; i < 4; ++i) {
      if (!(weight[i] > 0.0) || !is_coordinate(weight[i])) continue;
      if (!(joint[i] >= 0.0 && joint[i] < static_cast<double>(joint_count))) {
        return malformed_mesh(name_, source.path + ".JOINTS", "joint out of range",
                              index_text(joint_count, "joints"),
                              std::to_string(joint[i]) + " at vertex " + std::to_string(index));
      }
      out.joints[out.count++] = {static_cast<uint32_t>(joint[i]), weight[i]};
      out.weight_sum += weight[i];
    }
  }
  return out;
}

Result<glm::dmat4> GltfVertices::world_from_vertex(const GltfVertexSource& source,
                                                   uint32_t index) const {
  VOXELD_ASSIGN(const GltfVertexJoints bound, joints_of(source, index));
  if (bound.count == 0) return source.world_from_mesh;  // not bound to any joint
  glm::dmat4 sum(0.0);
  for (size_t i = 0; i < bound.count; ++i) {
    sum += bound.joints[i].second * (*source.world_from_bound)[bound.joints[i].first];
  }
  return sum / bound.weight_sum;
}

Result<bool> GltfVertices::is_mirrored(const GltfVertexSource& source, uint32_t index) const {
  VOXELD_ASSIGN(const glm::dmat4 matrix, world_from_vertex(source, index));
  return glm::determinant(glm::dmat3(matrix)) < 0.0;
}

// Weights are divided by their sum, although glTF 2.0, 3.7.3.3 asks writers for a sum of 1.
Status GltfVertices::append_to_rig(const GltfVertexSource& source, uint32_t index,
                                   SkinPart& skin) const {
  skin.points.emplace_back(source.position.vector(index));
  skin.normals.emplace_back(source.normal ? source.normal->vector(index) : glm::dvec4(0.0));
  VOXELD_ASSIGN(const GltfVertexJoints bound, joints_of(source, index));
  for (size_t i = 0; i < bound.count; ++i) {
    skin.influences.push_back({source.first_joint_matrix + bound.joints[i].first,
                               bound.joints[i].second / bound.weight_sum});
  }
  if (bound.count == 0) skin.influences.push_back({source.node_matrix, 1.0});
  for (const GltfVertexSource::Target& target : source.targets) {
    MorphDelta delta{.weight = source.first_weight + static_cast<uint32_t>(target.number)};
    if (target.position) delta.position = glm::vec3(target.position->vector(index));
    if (target.normal) delta.normal = glm::vec3(target.normal->vector(index));
    if (delta.position == glm::vec3(0.0f) && delta.normal == glm::vec3(0.0f)) continue;
    skin.morphs.push_back(delta);
  }
  return rig_->end_vertex(skin);
}

Status GltfVertices::append(const GltfVertexSource& source, uint32_t index, MeshPart& part,
                            SkinPart* skin) const {
  glm::dvec3 position(source.position.vector(index));
  glm::dvec3 normal(source.normal ? source.normal->vector(index) : glm::dvec4(0.0));
  for (const GltfVertexSource::Target& target : source.targets) {
    if (target.position) position += target.weight * glm::dvec3(target.position->vector(index));
    if (target.normal) normal += target.weight * glm::dvec3(target.normal->vector(index));
  }
  VOXELD_ASSIGN(const glm::dmat4 world_from_mesh, world_from_vertex(source, index));
  position = glm::dvec3(world_from_mesh * glm::dvec4(position, 1.0));
  if (!is_point(position)) {
    return malformed_mesh(name_, source.path + ".attributes.POSITION",
                          "vertex " + std::to_string(index) + " is at no finite place",
                          "coordinates of at most 1e30 in size", "");
  }
  if (skin != nullptr) VOXELD_TRY(append_to_rig(source, index, *skin));
  part.positions.push_back(position);
  if (source.normal) {
    part.normals.push_back(direction_of(world_normal(world_from_mesh, normal)));
  }
  if (source.uv) {
    part.uvs.push_back(transformed_uv(source.uv_transform, glm::dvec2(source.uv->vector(index))));
  }
  if (source.color) {
    const glm::dvec4 color = source.color->unit_vector(index);
    const auto component = [&](int i) { return unit_clamped(static_cast<float>(color[i])); };
    part.colors.emplace_back(component(0), component(1), component(2),
                             source.color->component_count() == 4 ? component(3) : 1.0f);
  }
  return {};
}

}  // namespace voxeld
