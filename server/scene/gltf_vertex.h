// One vertex of a glTF primitive as it stands in the world: morphed, skinned, transformed.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/gltf_accessor.h"
#include "server/scene/gltf_document.h"
#include "server/scene/gltf_nodes.h"
#include "server/scene/scene.h"

namespace voxeld {

// The open accessors of one primitive on one node.
struct GltfVertexSource {
  struct Target {
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
  glm::dmat4 world_from_mesh{1.0};  // of a mesh without skin
  std::vector<Influences> influences;
  const std::vector<glm::dmat4>* world_from_bound = nullptr;  // per joint; null: no skin
};

class GltfVertices {
 public:
  GltfVertices(std::string_view name, const GltfDocument& document, const GltfNodes& nodes,
               GltfAccessors& accessors)
      : name_(name), document_(document), nodes_(nodes), accessors_(accessors) {}

  // Errors: malformed-mesh, for accessors of wrong types, ranges and counts.
  Result<GltfVertexSource> open(int node, const GltfPrimitive& primitive, const std::string& path);
  // Appends vertex `index` < source.position.count() to every attribute of the part. Errors:
  // malformed-mesh for coordinates that are not finite, and joints that do not exist.
  Status append(const GltfVertexSource& source, uint32_t index, MeshPart& part) const;
  // Whether the transform mirrors, so that triangles turn the other way round.
  Result<bool> is_mirrored(const GltfVertexSource& source, uint32_t index) const;

 private:
  Result<std::optional<GltfReader>> open_attribute(const std::map<std::string, int>& attributes,
                                                   const std::string& key, int components_min,
                                                   int components_max,
                                                   const GltfVertexSource& source);
  Status open_targets(int node, const GltfPrimitive& primitive, GltfVertexSource& source);
  Status open_skin(int skin, const GltfPrimitive& primitive, GltfVertexSource& source);
  Status bind_joints(int skin);
  Result<glm::dmat4> world_from_vertex(const GltfVertexSource& source, uint32_t index) const;

  std::string_view name_;
  const GltfDocument& document_;
  const GltfNodes& nodes_;
  GltfAccessors& accessors_;
  std::map<int, std::vector<glm::dmat4>> world_from_bound_;  // by skin
};

}  // namespace voxeld
