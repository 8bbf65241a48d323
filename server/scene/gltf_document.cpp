// The only file that includes tinygltf. It gets a document without buffers, images and extras, with
// callbacks that open nothing, and after the checks of gltf_json.h: tinygltf reads files by ../ and
// from the working directory, takes 3 GB for a small PNG, overflows the stack in deep extras, and
// ends the process by assert().
#include "server/scene/gltf_document.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/scene/gltf_json.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

using Extensions = tinygltf::ExtensionMap;
using tinygltf::Value;

// Members that voxeld does not read, or reads itself.
constexpr const char* kWithheld[] = {"animations", "buffers", "cameras", "extensions",
                                     "extras",     "images",  "lights"};

void refuse_file_access(tinygltf::TinyGLTF& reader) {
  tinygltf::FsCallbacks none{};
  none.FileExists = [](const std::string&, void*) { return false; };
  none.ExpandFilePath = [](const std::string& path, void*) { return path; };
  none.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) {
    return false;
  };
  none.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                           void*) { return false; };
  reader.SetFsCallbacks(none);
  reader.SetImageLoader([](tinygltf::Image*, const int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
}

// An object of an extension; null where the element has none.
const Value* extension_of(const Extensions& extensions, const char* key) {
  const auto found = extensions.find(key);
  return found != extensions.end() && found->second.IsObject() ? &found->second : nullptr;
}

int int_of(const Value& object, const char* key, int absent) {
  return object.Has(key) && object.Get(key).IsNumber() ? object.Get(key).GetNumberAsInt() : absent;
}

double number_of(const Value& object, const char* key, double absent) {
  return object.Has(key) && object.Get(key).IsNumber() ? object.Get(key).GetNumberAsDouble()
                                                       : absent;
}

// Numbers of an array; empty where there is none.
std::vector<double> numbers_of(const Value& object, const char* key) {
  std::vector<double> numbers;
  if (!object.Has(key) || !object.Get(key).IsArray()) return numbers;
  const Value& array = object.Get(key);
  for (size_t i = 0; i < array.ArrayLen(); ++i) {
    const Value& number = array.Get(static_cast<int>(i));
    numbers.push_back(number.IsNumber() ? number.GetNumberAsDouble() : 0.0);
  }
  return numbers;
}

glm::dvec2 pair_of(const Value& object, const char* key, double absent) {
  const std::vector<double> numbers = numbers_of(object, key);
  return numbers.size() == 2 ? glm::dvec2(numbers[0], numbers[1]) : glm::dvec2(absent);
}

GltfAccessor accessor_of(const tinygltf::Accessor& from) {
  GltfAccessor to;
  to.view = from.bufferView;
  to.offset_bytes = from.byteOffset;
  to.count = from.count;
  to.component_type = from.componentType;
  to.normalized = from.normalized;
  switch (from.type) {
    case TINYGLTF_TYPE_SCALAR:
      to.component_count = 1;
      break;
    case TINYGLTF_TYPE_VEC2:
    case TINYGLTF_TYPE_VEC3:
    case TINYGLTF_TYPE_VEC4:
      to.component_count = from.type;
      break;
    case TINYGLTF_TYPE_MAT4:
      to.component_count = 16;
      break;
  }
  return to;
}

// tinygltf keeps offsets of sparse accessors in 32 bits and cuts what does not fit.
GltfSparse sparse_of(const nlohmann::json& from) {
  const auto& indices = from.at("indices");
  const auto& values = from.at("values");
  return {.count = from.at("count").get<uint64_t>(),
          .index_view = indices.at("bufferView").get<int>(),
          .value_view = values.at("bufferView").get<int>(),
          .index_offset_bytes = indices.value("byteOffset", uint64_t{0}),
          .value_offset_bytes = values.value("byteOffset", uint64_t{0}),
          .index_type = static_cast<int>(
              std::min(indices.at("componentType").get<uint64_t>(), uint64_t{65535}))};
}

void set_texture(GltfMaterial& material, int texture, int tex_coord, const Value* transform) {
  material.texture = texture;
  material.tex_coord = tex_coord;
  if (!transform) return;
  material.tex_coord = int_of(*transform, "texCoord", tex_coord);
  material.transform.offset = pair_of(*transform, "offset", 0.0);
  material.transform.scale = pair_of(*transform, "scale", 1.0);
  material.transform.rotation_rad = number_of(*transform, "rotation", 0.0);
}

void set_factor(GltfMaterial& material, const std::vector<double>& factor) {
  if (factor.size() != 4) return;
  for (int i = 0; i < 4; ++i) {
    material.base_color[i] = static_cast<float>(std::clamp(factor[i], 0.0, 1.0));
  }
}

// Diffuse colour and texture of the older workflow, where a file has both.
void set_specular_glossiness(GltfMaterial& material, const Value& extension) {
  material.base_color = glm::vec4(1.0f);
  material.texture = -1;
  material.base_color_given = extension.Has("diffuseFactor");
  set_factor(material, numbers_of(extension, "diffuseFactor"));
  if (!extension.Has("diffuseTexture") || !extension.Get("diffuseTexture").IsObject()) return;
  const Value& info = extension.Get("diffuseTexture");
  const Value* transform = nullptr;
  if (info.Has("extensions") && info.Get("extensions").IsObject() &&
      info.Get("extensions").Has("KHR_texture_transform")) {
    transform = &info.Get("extensions").Get("KHR_texture_transform");
  }
  set_texture(material, int_of(info, "index", -1), int_of(info, "texCoord", 0),
              transform && transform->IsObject() ? transform : nullptr);
}

GltfMaterial material_of(const tinygltf::Material& from, const nlohmann::json& json) {
  GltfMaterial to;
  to.name = from.name;
  const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
  const auto pbr_json = json.find("pbrMetallicRoughness");
  to.base_color_given = pbr_json != json.end() && pbr_json->contains("baseColorFactor");
  set_factor(to, pbr.baseColorFactor);
  if (pbr.baseColorTexture.index >= 0) {
    set_texture(to, pbr.baseColorTexture.index, pbr.baseColorTexture.texCoord,
                extension_of(pbr.baseColorTexture.extensions, "KHR_texture_transform"));
  }
  const Value* older = extension_of(from.extensions, "KHR_materials_pbrSpecularGlossiness");
  if (older) set_specular_glossiness(to, *older);
  return to;
}

Wrap wrap_of(int gl_wrap) {
  if (gl_wrap == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClamp;
  if (gl_wrap == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::kMirror;
  return Wrap::kRepeat;
}

GltfTexture texture_of(const tinygltf::Texture& from, const tinygltf::Model& model) {
  GltfTexture to;
  to.image = from.source;
  const Value* webp = extension_of(from.extensions, "EXT_texture_webp");
  if (webp) to.image = int_of(*webp, "source", to.image);
  if (from.sampler >= 0) {
    const tinygltf::Sampler& sampler = model.samplers.at(static_cast<size_t>(from.sampler));
    to.wrap_u = wrap_of(sampler.wrapS);
    to.wrap_v = wrap_of(sampler.wrapT);
  }
  return to;
}

// Sets matrix and transform.
Status set_transform(std::string_view name, size_t index, const tinygltf::Node& from,
                     GltfNode& to) {
  const auto wrong = [&](const char* member, size_t expected, size_t got) -> Error {
    return malformed_mesh(name, "nodes[" + std::to_string(index) + "]." + member,
                          "wrong count of numbers", std::to_string(expected), std::to_string(got));
  };
  if (!from.matrix.empty()) {
    if (from.matrix.size() != 16) return wrong("matrix", 16, from.matrix.size());
    to.parent_from_node = glm::make_mat4(from.matrix.data());
    to.has_matrix = true;
    return {};
  }
  const std::vector<double>&t = from.translation, &r = from.rotation, &s = from.scale;
  if (!t.empty()) {
    if (t.size() != 3) return wrong("translation", 3, t.size());
    to.transform.translation = {t[0], t[1], t[2]};
  }
  if (!r.empty()) {
    if (r.size() != 4) return wrong("rotation", 4, r.size());
    const glm::dquat q(r[3], r[0], r[1], r[2]);
    const double length = glm::length(q);
    if (length > 0.0 && std::isfinite(length)) to.transform.rotation = q / length;
  }
  if (!s.empty()) {
    if (s.size() != 3) return wrong("scale", 3, s.size());
    to.transform.scale = {s[0], s[1], s[2]};
  }
  to.parent_from_node = to.transform.matrix();
  return {};
}

GltfMesh mesh_of(const tinygltf::Mesh& from) {
  GltfMesh to{.name = from.name, .primitives = {}, .weights = from.weights};
  for (const tinygltf::Primitive& primitive : from.primitives) {
    to.primitives.push_back({.mode = primitive.mode,
                             .indices = primitive.indices,
                             .material = primitive.material,
                             .attributes = primitive.attributes,
                             .targets = primitive.targets});
  }
  return to;
}

std::optional<std::vector<int>> scene_nodes_of(const tinygltf::Model& model) {
  if (model.scenes.empty()) return std::nullopt;
  return model.scenes.at(static_cast<size_t>(std::max(model.defaultScene, 0))).nodes;
}

Result<GltfDocument> convert(std::string_view name, const tinygltf::Model& model,
                             const nlohmann::json& json) {
  GltfDocument to;
  for (const tinygltf::BufferView& view : model.bufferViews) {
    to.views.push_back({view.buffer, view.byteOffset, view.byteLength, view.byteStride});
  }
  for (size_t i = 0; i < model.accessors.size(); ++i) {
    to.accessors.push_back(accessor_of(model.accessors[i]));
    const nlohmann::json& accessor_json = json.at("accessors").at(i);
    if (accessor_json.contains("sparse")) {
      to.accessors.back().sparse = sparse_of(accessor_json.at("sparse"));
    }
  }
  for (size_t i = 0; i < model.materials.size(); ++i) {
    to.materials.push_back(material_of(model.materials[i], json.at("materials").at(i)));
  }
  for (const tinygltf::Texture& texture : model.textures) {
    to.textures.push_back(texture_of(texture, model));
  }
  for (const tinygltf::Mesh& mesh : model.meshes) to.meshes.push_back(mesh_of(mesh));
  for (const tinygltf::Skin& skin : model.skins) {
    to.skins.push_back({skin.inverseBindMatrices, skin.joints});
  }
  for (size_t i = 0; i < model.nodes.size(); ++i) {
    const tinygltf::Node& node = model.nodes[i];
    GltfNode& out = to.nodes.emplace_back();
    out.name = node.name;
    out.mesh = node.mesh;
    out.skin = node.skin;
    out.children = node.children;
    out.weights = node.weights;
    VOXELD_TRY(set_transform(name, i, node, out));
  }
  to.scene_nodes = scene_nodes_of(model);
  return to;
}

}  // namespace

glm::dmat4 GltfTransform::matrix() const {
  glm::dmat4 out = glm::mat4_cast(rotation);
  for (int i = 0; i < 3; ++i) out[i] *= scale[i];
  out[3] = glm::dvec4(translation, 1.0);
  return out;
}

Result<GltfDocument> read_gltf_document(std::string_view name, nlohmann::json document) {
  for (const char* key : kWithheld) document.erase(key);
  // No base URIs and few extras are left, so this text is small.
  const std::string text = document.dump();
  if (text.size() > std::numeric_limits<unsigned>::max()) {
    return malformed_mesh(name, "", "bytes of JSON",
                          "at most " + std::to_string(std::numeric_limits<unsigned>::max()),
                          std::to_string(text.size()));
  }
  tinygltf::TinyGLTF reader;
  refuse_file_access(reader);
  tinygltf::Model model;
  std::string error, warning;
  bool ok = false;
  try {
    ok = reader.LoadASCIIFromString(&model, &error, &warning, text.data(),
                                    static_cast<unsigned>(text.size()), "");
  } catch (const std::exception& e) {
    error = e.what();
  }
  if (!ok) {
    while (!error.empty() && error.back() == '\n') error.pop_back();
    return malformed_mesh(name, "", printable(error));
  }
  return convert(name, model, document);
}

}  // namespace voxeld
