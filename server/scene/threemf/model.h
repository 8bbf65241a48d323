// One model part of a 3MF package, as plain data: the core specification 1.3, its materials
// extension (colours, textures) and the paths of its production extension.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld::threemf {

// Objects, property groups and their members, components and build items of one part. More:
// malformed-mesh.
inline constexpr size_t kResourcesMax = size_t{1} << 20;

// Property `index` of group `group`; group 0: none (identifiers begin with 1).
struct Property {
  uint32_t group = 0, index = 0;
  bool operator==(const Property&) const = default;
};

struct Reference {
  std::string path;  // of the model part with the object; empty: this one
  uint32_t object = 0;
  glm::dmat4 transform{1.0};
  int64_t line = 0;
};

struct Object {
  std::string name, type = "model";
  Property property;  // of triangles without one of their own
  std::vector<glm::dvec3> vertices;
  std::vector<uint32_t> corners;  // three for each triangle
  // Three for each triangle, one for each corner; empty if no triangle has any.
  std::vector<Property> properties;
  std::vector<Reference> components;
};

struct BaseMaterial {
  std::string name;
  glm::vec4 color{1.0f};  // linear
};

// basematerials, colorgroup or texture2dgroup: one of the lists is in use.
struct PropertyGroup {
  std::vector<BaseMaterial> materials;
  std::vector<glm::vec4> colors;  // linear
  uint32_t texture = 0;           // 0: no texture2dgroup
  std::vector<glm::vec2> uvs;     // (0,0) is the top left texel corner
};

struct TextureSource {
  std::string path;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

struct Model {
  std::string name;  // of the file, for errors
  std::map<uint32_t, Object> objects;
  std::map<uint32_t, PropertyGroup> groups;
  std::map<uint32_t, TextureSource> textures;
  std::vector<Reference> items;           // of the build
  std::set<std::string> unread_elements;  // names of elements of other namespaces, at most 16
};

// Reads one part. Triangles' corners are below the number of their object's vertices; properties
// and references are as the file has them. Errors: malformed-mesh with the line;
// unsupported-feature for an extension that the file requires and voxeld does not read.
Result<Model> read_model(std::string_view name, std::span<const uint8_t> bytes);

// Whether the text is the beginning of a model part.
bool looks_like_model(std::string_view head);

}  // namespace voxeld::threemf
