// A glTF document as plain data, reduced to what voxeld uses, with defaults filled in. Every index
// names an existing element. Byte ranges are checked only when an accessor is opened
// (gltf_accessor.h).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/scene.h"

namespace voxeld {

struct GltfView {
  int buffer = -1;
  uint64_t offset_bytes = 0, length_bytes = 0;
  uint64_t stride_bytes = 0;  // 0: tightly packed
};

// Elements of an accessor that replace those of its buffer view, or zeros.
struct GltfSparse {
  uint64_t count = 0;
  int index_view = -1, value_view = -1;
  uint64_t index_offset_bytes = 0, value_offset_bytes = 0;
  int index_type = 0;  // a component type
};

struct GltfAccessor {
  int view = -1;  // -1: zeros
  uint64_t offset_bytes = 0;
  uint64_t count = 0;
  int component_type = 0;   // 5120 i8, 5121 u8, 5122 i16, 5123 u16, 5125 u32, 5126 float
  int component_count = 0;  // gltf_component_count()
  bool normalized = false;
  std::optional<GltfSparse> sparse;
};

struct GltfTextureTransform {
  glm::dvec2 offset{0.0}, scale{1.0};
  double rotation_rad = 0.0;
};

struct GltfMaterial {
  std::string name;
  glm::vec4 base_color{1.0f};  // linear
  bool base_color_given = false;
  int texture = -1;
  int tex_coord = 0;  // N of TEXCOORD_N
  GltfTextureTransform transform;
};

struct GltfTexture {
  int image = -1;             // -1: no image in a format that voxeld reads
  std::string unread_format;  // the extension of an image that voxeld does not read; empty: none
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

struct GltfPrimitive {
  int mode = 4;
  int indices = -1;  // accessor
  int material = -1;
  std::map<std::string, int> attributes;            // accessors
  std::vector<std::map<std::string, int>> targets;  // of morphing
  std::string compressed_by;                        // an extension; empty: none
};

struct GltfMesh {
  std::string name;
  std::vector<GltfPrimitive> primitives;
  std::vector<double> weights;
};

struct GltfSkin {
  int inverse_bind_matrices = -1;  // accessor; -1: identities
  std::vector<int> joints;         // nodes
};

// A transform: scales first, then rotates, then translates.
struct GltfTransform {
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};  // of length 1
  glm::dvec3 scale{1.0};
  glm::dmat4 matrix() const;
};

struct GltfNode {
  std::string name;
  int mesh = -1, skin = -1;
  std::vector<int> children;
  std::vector<double> weights;  // empty: those of the mesh apply
  glm::dmat4 parent_from_node{1.0};
  // The parts of parent_from_node, if the file gives no matrix.
  bool has_matrix = false;
  GltfTransform transform;
};

struct GltfDocument {
  std::vector<GltfView> views;
  std::vector<GltfAccessor> accessors;
  std::vector<GltfMaterial> materials;
  std::vector<GltfTexture> textures;
  std::vector<GltfMesh> meshes;
  std::vector<GltfSkin> skins;
  std::vector<GltfNode> nodes;
  // Nodes of the default scene, or of the first scene if there is no default; nullopt: no scenes.
  std::optional<std::vector<int>> scene_nodes;
};

// Components of an accessor's type: "VEC3" has 3, "MAT4" 16. 0 for a type that voxeld does not
// read, nullopt for an unknown type.
std::optional<int> gltf_component_count(std::string_view type);

// Reads a document that passed check_gltf_schema. Errors: malformed-mesh.
Result<GltfDocument> read_gltf_document(std::string_view name, const nlohmann::json& document);

}  // namespace voxeld
