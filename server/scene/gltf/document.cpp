#include "server/scene/gltf/document.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/scene/gltf/extensions.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

constexpr int kGlClampToEdge = 33071;
constexpr int kGlMirroredRepeat = 33648;

// Members of a document that passed check_gltf_schema: each is absent or of its type.

uint64_t size_of(const Json& object, const char* key) {
  return object.value(key, uint64_t{0});
}

// A small integer. Larger ones, up to 2^53, become the largest int, which is invalid everywhere.
int int_of(const Json& object, const char* key, int absent) {
  const auto member = object.find(key);
  if (member == object.end()) return absent;
  return static_cast<int>(
      std::min(member->get<uint64_t>(), uint64_t{std::numeric_limits<int>::max()}));
}

std::string text_of(const Json& object, const char* key) {
  return object.value(key, std::string());
}

template <typename T>
std::vector<T> array_of(const Json& object, const char* key) {
  return object.value(key, std::vector<T>());
}

std::map<std::string, int> index_map_of(const Json& object) {
  std::map<std::string, int> indices;
  for (const auto& [key, index] : object.items()) indices.emplace(key, index.get<int>());
  return indices;
}

glm::dvec2 pair_of(const Json& object, const char* key, double absent) {
  const std::vector<double> numbers = array_of<double>(object, key);
  return numbers.size() == 2 ? glm::dvec2(numbers[0], numbers[1]) : glm::dvec2(absent);
}

// Returns null if the element lacks the extension.
const Json* extension_of(const Json& element, const char* name) {
  const auto extensions = element.find("extensions");
  if (extensions == element.end()) return nullptr;
  const auto found = extensions->find(name);
  return found != extensions->end() ? &*found : nullptr;
}

// Calls read(element) for each element of a top-level array.
template <typename Read>
void for_each(const Json& document, const char* array, const Read& read) {
  const auto elements = document.find(array);
  if (elements == document.end()) return;
  for (const Json& element : *elements) read(element);
}

GltfView view_of(const Json& from) {
  return {.buffer = int_of(from, "buffer", -1),
          .offset_bytes = size_of(from, "byteOffset"),
          .length_bytes = size_of(from, "byteLength"),
          .stride_bytes = size_of(from, "byteStride")};
}

GltfSparse sparse_of(const Json& from) {
  const Json& indices = from.at("indices");
  const Json& values = from.at("values");
  return {.count = size_of(from, "count"),
          .index_view = int_of(indices, "bufferView", -1),
          .value_view = int_of(values, "bufferView", -1),
          .index_offset_bytes = size_of(indices, "byteOffset"),
          .value_offset_bytes = size_of(values, "byteOffset"),
          .index_type = int_of(indices, "componentType", 0)};
}

GltfAccessor accessor_of(const Json& from) {
  GltfAccessor to{.view = int_of(from, "bufferView", -1),
                  .offset_bytes = size_of(from, "byteOffset"),
                  .count = size_of(from, "count"),
                  .component_type = int_of(from, "componentType", 0),
                  .component_count = gltf_component_count(text_of(from, "type")).value_or(0),
                  .normalized = from.value("normalized", false),
                  .sparse = {}};
  const auto sparse = from.find("sparse");
  if (sparse != from.end()) to.sparse = sparse_of(*sparse);
  return to;
}

void set_texture(GltfMaterial& material, const Json& info) {
  material.texture = int_of(info, "index", -1);
  material.tex_coord = int_of(info, "texCoord", 0);
  const Json* transform = extension_of(info, "KHR_texture_transform");
  if (transform == nullptr) return;
  material.tex_coord = int_of(*transform, "texCoord", material.tex_coord);
  material.transform.offset = pair_of(*transform, "offset", 0.0);
  material.transform.scale = pair_of(*transform, "scale", 1.0);
  material.transform.rotation_rad = transform->value("rotation", 0.0);
}

// Sets colour and texture of the workflow with these keys.
void set_base(GltfMaterial& material, const Json& from, const char* factor_key,
              const char* texture_key) {
  material.base_color_given = from.contains(factor_key);
  const std::vector<double> factor = array_of<double>(from, factor_key);
  for (int i = 0; i < 4 && factor.size() == 4; ++i) {
    material.base_color[i] =
        static_cast<float>(std::clamp(factor[static_cast<size_t>(i)], 0.0, 1.0));
  }
  const auto texture = from.find(texture_key);
  if (texture != from.end()) set_texture(material, *texture);
}

GltfMaterial material_of(const Json& from) {
  GltfMaterial to;
  // If a file has both workflows, the older one carries more information.
  const Json* older = extension_of(from, "KHR_materials_pbrSpecularGlossiness");
  const auto pbr = from.find("pbrMetallicRoughness");
  if (older != nullptr) {
    set_base(to, *older, "diffuseFactor", "diffuseTexture");
  } else if (pbr != from.end()) {
    set_base(to, *pbr, "baseColorFactor", "baseColorTexture");
  }
  to.name = text_of(from, "name");
  return to;
}

Wrap wrap_of(const Json& sampler, const char* key) {
  const int wrap = int_of(sampler, key, 0);
  if (wrap == kGlClampToEdge) return Wrap::kClamp;
  return wrap == kGlMirroredRepeat ? Wrap::kMirror : Wrap::kRepeat;
}

GltfTexture texture_of(const Json& from, const Json& document) {
  GltfTexture to{.image = int_of(from, "source", -1), .unread_format = {}};
  if (const Json* webp = extension_of(from, "EXT_texture_webp")) {
    to.image = int_of(*webp, "source", to.image);
  }
  if (from.contains("extensions")) {
    for (const auto& [extension, unused] : from.at("extensions").items()) {
      if (!is_texture_extension(extension) || is_read_extension(extension)) continue;
      to.unread_format = extension;
    }
  }
  const int sampler = int_of(from, "sampler", -1);
  if (sampler >= 0) {
    const Json& element = document.at("samplers").at(static_cast<size_t>(sampler));
    to.wrap_u = wrap_of(element, "wrapS");
    to.wrap_v = wrap_of(element, "wrapT");
  }
  return to;
}

GltfMesh mesh_of(const Json& from) {
  GltfMesh to{.name = text_of(from, "name"),
              .primitives = {},
              .weights = array_of<double>(from, "weights")};
  for (const Json& primitive : from.at("primitives")) {
    GltfPrimitive& out = to.primitives.emplace_back();
    out.mode = int_of(primitive, "mode", 4);
    out.indices = int_of(primitive, "indices", -1);
    out.material = int_of(primitive, "material", -1);
    out.attributes = index_map_of(primitive.at("attributes"));
    if (primitive.contains("targets")) {
      for (const Json& target : primitive.at("targets")) {
        out.targets.push_back(index_map_of(target));
      }
    }
    constexpr const char* kDraco = "KHR_draco_mesh_compression";
    if (extension_of(primitive, kDraco) != nullptr) out.compressed_by = kDraco;
  }
  return to;
}

// Sets the node's matrix and transform.
Status set_transform(std::string_view name, size_t index, const Json& from, GltfNode& to) {
  const auto read = [&](const char* key, size_t count) -> Result<std::vector<double>> {
    std::vector<double> numbers = array_of<double>(from, key);
    if (numbers.empty() || numbers.size() == count) return numbers;
    return malformed_mesh(name, "nodes[" + std::to_string(index) + "]." + key,
                          "wrong count of numbers", std::to_string(count),
                          std::to_string(numbers.size()));
  };
  VOXELD_ASSIGN(const std::vector<double> matrix, read("matrix", 16));
  if (!matrix.empty()) {
    to.parent_from_node = glm::make_mat4(matrix.data());
    to.has_matrix = true;
    return {};
  }
  VOXELD_ASSIGN(const std::vector<double> t, read("translation", 3));
  VOXELD_ASSIGN(const std::vector<double> r, read("rotation", 4));
  VOXELD_ASSIGN(const std::vector<double> s, read("scale", 3));
  if (!t.empty()) to.transform.translation = {t[0], t[1], t[2]};
  if (!r.empty()) {
    const glm::dquat q(r[3], r[0], r[1], r[2]);
    const double length = glm::length(q);
    if (length > 0.0 && std::isfinite(length)) to.transform.rotation = q / length;
  }
  if (!s.empty()) to.transform.scale = {s[0], s[1], s[2]};
  to.parent_from_node = to.transform.matrix();
  return {};
}

Result<std::vector<GltfNode>> nodes_of(std::string_view name, const Json& document) {
  std::vector<GltfNode> nodes;
  Status all;
  for_each(document, "nodes", [&](const Json& from) {
    GltfNode& to = nodes.emplace_back();
    to.name = text_of(from, "name");
    to.mesh = int_of(from, "mesh", -1);
    to.skin = int_of(from, "skin", -1);
    to.children = array_of<int>(from, "children");
    to.weights = array_of<double>(from, "weights");
    if (all) all = set_transform(name, nodes.size() - 1, from, to);
  });
  VOXELD_TRY(all);
  return nodes;
}

std::optional<std::vector<int>> scene_nodes_of(const Json& document) {
  const auto scenes = document.find("scenes");
  if (scenes == document.end() || scenes->empty()) return std::nullopt;
  return array_of<int>(scenes->at(static_cast<size_t>(int_of(document, "scene", 0))), "nodes");
}

}  // namespace

glm::dmat4 GltfTransform::matrix() const {
  glm::dmat4 out = glm::mat4_cast(rotation);
  for (int i = 0; i < 3; ++i) out[i] *= scale[i];
  out[3] = glm::dvec4(translation, 1.0);
  return out;
}

std::optional<int> gltf_component_count(std::string_view type) {
  constexpr std::pair<std::string_view, int> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 0}, {"MAT3", 0}, {"MAT4", 16}};
  for (const auto& [name, count] : kTypes) {
    if (name == type) return count;
  }
  return std::nullopt;
}

Result<GltfDocument> read_gltf_document(std::string_view name, const Json& document) {
  GltfDocument to;
  for_each(document, "bufferViews", [&](const Json& e) { to.views.push_back(view_of(e)); });
  for_each(document, "accessors", [&](const Json& e) { to.accessors.push_back(accessor_of(e)); });
  for_each(document, "materials", [&](const Json& e) { to.materials.push_back(material_of(e)); });
  for_each(document, "textures",
           [&](const Json& e) { to.textures.push_back(texture_of(e, document)); });
  for_each(document, "meshes", [&](const Json& e) { to.meshes.push_back(mesh_of(e)); });
  for_each(document, "skins", [&](const Json& e) {
    to.skins.push_back({.inverse_bind_matrices = int_of(e, "inverseBindMatrices", -1),
                        .joints = array_of<int>(e, "joints")});
  });
  VOXELD_ASSIGN(to.nodes, nodes_of(name, document));
  to.scene_nodes = scene_nodes_of(document);
  return to;
}

}  // namespace voxeld
