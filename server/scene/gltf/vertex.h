// One vertex of a glTF primitive in world space: morphed, skinned, transformed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/nodes.h"
#include "server/scene/gltf/rig.h"
#include "server/scene/scene.h"

namespace voxeld {

// The open accessors of one primitive on one node.
struct GltfVertexSource {
  struct Target {
    size_t number;
    double weight;
    std::optional<GltfReader> position, normal;
  };
  struct Influences {  // JOINTS_n and WEIGHTS_n
    GltfReader joints, weights;
  };
  std::string path;  // "meshes[0].primitives[1]"
  GltfReader position;
  std::optional<GltfReader> normal, uv, color;
  GltfTextureTransform uv_transform;
  std::vector<Target> targets;
  glm::dmat4 world_from_mesh{1.0};  // of a mesh without a skin
  std::vector<Influences> influences;
  const std::vector<glm::dmat4>* world_from_bound = nullptr;  // per joint; null: no skin
  // Indices of a rig's matrices and weights: GltfRigBuilder.
  uint32_t node_matrix = 0, first_joint_matrix = 0, first_weight = 0;
};

// The joints that a vertex is bound to with a weight above 0.
struct GltfVertexJoints {
  static constexpr int kSetsMax = 4;  // sets of four; real files have at most two
  std::array<std::pair<uint32_t, double>, size_t{4} * kSetsMax> joints;
  size_t count = 0;
  double weight_sum = 0.0;
};

class GltfVertices {
 public:
  // `rig`: null if the caller needs no bindings.
  GltfVertices(std::string_view name, const GltfDocument& document, const GltfNodes& nodes,
               GltfAccessors& accessors, GltfRigBuilder* rig)
      : name_(name), document_(document), nodes_(nodes), accessors_(accessors), rig_(rig) {}

  // Errors: malformed-mesh, for accessors of wrong types, ranges and counts.
  Result<GltfVertexSource> open(int node, const GltfPrimitive& primitive, const std::string& path);
  // Appends vertex `index` < source.position.count() to every attribute of the part, and to `skin`,
  // the part's table in the rig (null without a rig). Errors: malformed-mesh for coordinates that
  // are not finite, and for joints that do not exist.
  Status append(const GltfVertexSource& source, uint32_t index, MeshPart& part,
                SkinPart* skin) const;
  // Whether the transform mirrors, which reverses the orientation of triangles.
  Result<bool> is_mirrored(const GltfVertexSource& source, uint32_t index) const;

 private:
  Result<std::optional<GltfReader>> open_attribute(const std::map<std::string, int>& attributes,
                                                   const std::string& key, int components_min,
                                                   int components_max,
                                                   const GltfVertexSource& source);
  Status open_targets(int node, const GltfPrimitive& primitive, GltfVertexSource& source);
  Status open_skin(int skin, const GltfPrimitive& primitive, GltfVertexSource& source);
  Status bind_joints(int skin);
  Result<GltfVertexJoints> joints_of(const GltfVertexSource& source, uint32_t index) const;
  Result<glm::dmat4> world_from_vertex(const GltfVertexSource& source, uint32_t index) const;
  Status append_to_rig(const GltfVertexSource& source, uint32_t index, SkinPart& skin) const;

  std::string_view name_;
  const GltfDocument& document_;
  const GltfNodes& nodes_;
  GltfAccessors& accessors_;
  GltfRigBuilder* rig_;
  std::map<int, std::vector<glm::dmat4>> world_from_bound_, inverse_bind_;  // by skin
};

}  // namespace voxeld
