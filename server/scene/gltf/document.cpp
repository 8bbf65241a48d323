#include "server/scene/gltf/document.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/gtc/type_ptr.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/json_object.h"
#include "server/scene/gltf/json_text.h"

namespace voxeld::gltf {
namespace {

using Json = nlohmann::json;

constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";
constexpr const char* kVariants = "KHR_materials_variants";
constexpr const char* kMeshopt[] = {"KHR_meshopt_compression", "EXT_meshopt_compression"};

constexpr std::string_view kReadExtensions =
    "KHR_draco_mesh_compression, KHR_materials_*, KHR_mesh_quantization, KHR_texture_transform, "
    "EXT_mesh_gpu_instancing, EXT_meshopt_compression, EXT_texture_webp";

// Whether the extension is read, or does not affect shape and base colour.
bool is_read_extension(std::string_view name) {
  constexpr std::array<std::string_view, 10> kNames = {kDraco,
                                                       kInstancing,
                                                       kMeshopt[0],
                                                       kMeshopt[1],
                                                       "EXT_texture_webp",
                                                       "KHR_animation_pointer",
                                                       "KHR_lights_punctual",
                                                       "KHR_mesh_quantization",
                                                       "KHR_texture_transform",
                                                       "KHR_xmp_json_ld"};
  return name.starts_with("KHR_materials_") ||
         std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

// Whether the extension is a texture format. Without it the shape is complete, but colours are
// missing.
bool is_texture_extension(std::string_view name) {
  return name.starts_with("KHR_texture_") || name.starts_with("EXT_texture_") ||
         name.starts_with("MSFT_texture_");
}

// Removes blanks and control characters at the ends of a URI, as in the WHATWG URL standard.
void trim(std::string& uri) {
  const auto is_blank = [](char c) { return static_cast<unsigned char>(c) <= 0x20; };
  uri.erase(std::find_if_not(uri.rbegin(), uri.rend(), is_blank).base(), uri.end());
  uri.erase(uri.begin(), std::find_if_not(uri.begin(), uri.end(), is_blank));
}

}  // namespace

// The part of the glTF 2.0 schema that voxeld reads: one function per object (json_object.h), with
// its members in alphabetical order. They are static instead of in the unnamed namespace, so that
// JsonObject finds them by their arguments.

static void members(JsonObject o, Sparse& to) {
  o.required("count", to.count);
  o.required("indices", [&](JsonObject indices) {
    indices.required("bufferView", to.index_view, "bufferViews");
    indices.optional("byteOffset", to.index_offset_bytes);
    indices.required("componentType", to.index_type);
  });
  o.required("values", [&](JsonObject values) {
    values.required("bufferView", to.value_view, "bufferViews");
    values.optional("byteOffset", to.value_offset_bytes);
  });
}

static void members(JsonObject o, Accessor& to) {
  constexpr std::pair<std::string_view, int> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 0}, {"MAT3", 0}, {"MAT4", 16}};
  o.optional("bufferView", to.view, "bufferViews");
  o.optional("byteOffset", to.offset_bytes);
  o.required("componentType", to.component_type);
  o.required("count", to.count);
  o.optional("normalized", to.normalized);
  if (o.has("sparse")) o.optional("sparse", to.sparse.emplace());
  std::string type;
  o.required("type", type);
  const auto* found = std::find_if(std::begin(kTypes), std::end(kTypes),
                                   [&](const auto& known) { return known.first == type; });
  if (found == std::end(kTypes)) {
    return o.refuse("type", "wrong value", "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4",
                    shown(type));
  }
  to.component_count = found->second;
}

static void members(JsonObject o, Buffer& to) {
  o.required("byteLength", to.length_bytes);
  o.optional("extensions", [&](JsonObject extensions) {
    for (const char* name : kMeshopt) {
      extensions.optional(name, [&](JsonObject) { to.fallback_of = name; });
    }
  });
  if (!o.has("uri")) return;
  o.optional("uri", to.uri.emplace());
  trim(*to.uri);
}

static void members(JsonObject o, CompressedView& to) {
  o.required("buffer", to.buffer, "buffers");
  o.required("byteLength", to.length_bytes);
  o.optional("byteOffset", to.offset_bytes);
  o.required("byteStride", to.stride_bytes);
  o.required("count", to.count);
  o.optional("filter", to.filter);
  o.required("mode", to.mode);
}

static void members(JsonObject o, View& to) {
  o.required("buffer", to.buffer, "buffers");
  o.required("byteLength", to.length_bytes);
  o.optional("byteOffset", to.offset_bytes);
  o.optional("byteStride", to.stride_bytes);
  o.optional("extensions", [&](JsonObject extensions) {
    for (const char* name : kMeshopt) {
      if (!extensions.has(name)) continue;
      extensions.optional(name, to.compressed.emplace());
      to.compressed->extension = name;
    }
  });
  // glTF asks for a multiple of 4, but exporters write 3 for colours of bytes.
  if (to.stride_bytes > 252) {
    o.refuse("byteStride", "wrong value", "4 to 252", std::to_string(to.stride_bytes));
  }
}

static void members(JsonObject o, ImageSource& to) {
  o.optional("bufferView", to.view, "bufferViews");
  o.optional("name", to.name);
  o.optional("uri", to.uri);
  trim(to.uri);
}

static void members(JsonObject o, Texture& to) {
  int webp = -1;
  o.optional("extensions", [&](JsonObject extensions) {
    extensions.optional("EXT_texture_webp",
                        [&](JsonObject e) { e.optional("source", webp, "images"); });
    for (const auto& [name, unused] : extensions.json().items()) {
      if (is_texture_extension(name) && !is_read_extension(name)) to.unread_format = name;
    }
  });
  o.optional("sampler", to.sampler, "samplers");
  o.optional("source", to.image, "images");
  if (webp >= 0) to.image = webp;
}

static void members(JsonObject o, Sampler& to) {
  const auto wrap = [&](const char* key, Wrap& mode) {
    constexpr int kGlClampToEdge = 33071, kGlMirroredRepeat = 33648;
    int value = 0;
    o.optional(key, value);
    if (value == kGlClampToEdge) mode = Wrap::kClamp;
    if (value == kGlMirroredRepeat) mode = Wrap::kMirror;
  };
  wrap("wrapS", to.wrap_u);
  wrap("wrapT", to.wrap_v);
}

static void members(JsonObject o, TextureTransform& to) {
  const auto pair = [&](const char* key, glm::dvec2& out) {
    std::vector<double> numbers;
    o.optional(key, numbers);
    if (numbers.size() == 2) out = {numbers[0], numbers[1]};
  };
  pair("offset", to.offset);
  o.optional("rotation", to.rotation_rad);
  pair("scale", to.scale);
}

// Reads the base colour of one workflow, whose members have these names.
static void read_base(JsonObject o, const char* factor_key, const char* texture_key,
                      MaterialSource& to) {
  std::vector<double> factor;
  o.optional(factor_key, factor);
  to.base_color_given = o.has(factor_key);
  for (int i = 0; i < 4 && factor.size() == 4; ++i) {
    to.base_color[i] = static_cast<float>(std::clamp(factor[i], 0.0, 1.0));
  }
  o.optional(texture_key, [&](JsonObject info) {
    std::optional<int> transformed_tex_coord;
    info.optional("extensions", [&](JsonObject extensions) {
      extensions.optional("KHR_texture_transform", [&](JsonObject transform) {
        members(transform, to.transform);
        if (!transform.has("texCoord")) return;
        transform.optional("texCoord", transformed_tex_coord.emplace());
      });
    });
    info.required("index", to.texture, "textures");
    info.optional("texCoord", to.tex_coord);
    to.tex_coord = transformed_tex_coord.value_or(to.tex_coord);
  });
}

// Reads KHR_materials_pbrSpecularGlossiness. The colour of a metal is its specularFactor, and its
// diffuseFactor is black.
static void read_specular_glossiness(JsonObject o, MaterialSource& to) {
  constexpr float kDielectricSpecular = 0.04f;
  read_base(o, "diffuseFactor", "diffuseTexture", to);
  std::vector<double> factor;
  o.optional("specularFactor", factor);
  if (factor.size() != 3 || to.texture >= 0 || o.has("specularGlossinessTexture")) return;
  const glm::vec3 specular = glm::clamp(glm::vec3(factor[0], factor[1], factor[2]), 0.0f, 1.0f);
  const float largest = std::max({specular.x, specular.y, specular.z});
  const float metallic = std::max(largest - kDielectricSpecular, 0.0f) / (1 - kDielectricSpecular);
  const glm::vec3 diffuse(to.base_color);
  to.base_color =
      glm::vec4(glm::mix(diffuse, glm::max(diffuse, specular), metallic), to.base_color.a);
}

static void members(JsonObject o, MaterialSource& to) {
  std::optional<MaterialSource> older;
  o.optional("extensions", [&](JsonObject extensions) {
    extensions.optional("KHR_materials_pbrSpecularGlossiness", [&](JsonObject workflow) {
      read_specular_glossiness(workflow, older.emplace());
    });
  });
  std::string name, alpha_mode = "OPAQUE";
  double cutoff = 0.5;
  o.optional("alphaMode", alpha_mode);
  o.optional("alphaCutoff", cutoff);
  o.optional("name", name);
  o.optional("pbrMetallicRoughness", [&](JsonObject workflow) {
    read_base(workflow, "baseColorFactor", "baseColorTexture", to);
  });
  // With the older workflow, many exporters write a white base colour or one without the texture.
  const bool has_base = to.texture >= 0 || to.base_color != glm::vec4(1.0f);
  if (older && (!has_base || (older->texture >= 0 && to.texture < 0))) to = *std::move(older);
  to.name = std::move(name);
  if (alpha_mode == "MASK") to.alpha_cutoff = cutoff;
  if (alpha_mode == "BLEND") to.alpha_cutoff.reset();
}

static void members(JsonObject o, DracoSource& to) {
  o.required("attributes", to.ids);
  o.required("bufferView", to.view, "bufferViews");
}

struct VariantName {
  std::string name;
};

static void members(JsonObject o, VariantName& to) {
  o.required("name", to.name);
}

static void members(JsonObject o, VariantMaterial& to) {
  o.required("material", to.material, "materials");
  o.required("variants", to.variants);
}

static void members(JsonObject o, Primitive& to) {
  o.required("attributes", to.attributes, "accessors");
  o.optional("extensions", [&](JsonObject extensions) {
    if (extensions.has(kDraco)) extensions.optional(kDraco, to.draco.emplace());
    extensions.optional(kVariants, [&](JsonObject by) { by.required("mappings", to.variants); });
  });
  o.optional("indices", to.indices, "accessors");
  o.optional("material", to.material, "materials");
  o.optional("mode", to.mode);
  o.optional("targets", to.targets, "accessors");
}

static void members(JsonObject o, Mesh& to) {
  o.optional("name", to.name);
  o.required("primitives", to.primitives);
  o.optional("weights", to.weights);
}

static void members(JsonObject o, Node& to) {
  std::vector<double> matrix, rotation, scale, translation;
  o.optional("children", to.children, "nodes");
  o.optional("extensions", [&](JsonObject extensions) {
    extensions.optional(kInstancing, [&](JsonObject instancing) {
      instancing.required("attributes", to.instances.emplace(), "accessors");
    });
  });
  o.optional("matrix", matrix);
  o.optional("mesh", to.mesh, "meshes");
  o.optional("name", to.name);
  o.optional("rotation", rotation);
  o.optional("scale", scale);
  o.optional("skin", to.skin, "skins");
  o.optional("translation", translation);
  o.optional("weights", to.weights);
  const auto is_given = [&](const char* key, const std::vector<double>& numbers, size_t count) {
    if (numbers.empty() || numbers.size() == count) return !numbers.empty();
    o.refuse(key, "wrong count of numbers", std::to_string(count), std::to_string(numbers.size()));
    return false;
  };
  to.has_matrix = is_given("matrix", matrix, 16);
  if (to.has_matrix) {
    to.parent_from_node = glm::make_mat4(matrix.data());
    return;
  }
  if (is_given("translation", translation, 3)) {
    to.transform.translation = glm::make_vec3(translation.data());
  }
  if (is_given("rotation", rotation, 4)) {
    const glm::dquat q(rotation[3], rotation[0], rotation[1], rotation[2]);
    const double length = glm::length(q);
    if (length > 0.0 && std::isfinite(length)) to.transform.rotation = q / length;
  }
  if (is_given("scale", scale, 3)) to.transform.scale = glm::make_vec3(scale.data());
  to.parent_from_node = to.transform.matrix();
}

static void members(JsonObject o, SceneSource& to) {
  o.optional("nodes", to.nodes, "nodes");
}

static void members(JsonObject o, Skin& to) {
  o.optional("inverseBindMatrices", to.inverse_bind_matrices, "accessors");
  o.required("joints", to.joints, "nodes");
}

static void members(JsonObject o, ChannelSource& to) {
  o.required("sampler", to.sampler);
  o.required("target", [&](JsonObject target) {
    target.optional("node", to.node, "nodes");
    target.required("path", to.path);
  });
}

static void members(JsonObject o, KeySampler& to) {
  o.required("input", to.times, "accessors");
  o.optional("interpolation", to.interpolation);
  o.required("output", to.values, "accessors");
}

static void members(JsonObject o, AnimationSource& to) {
  o.required("channels", to.channels);
  o.optional("name", to.name);
  o.required("samplers", to.samplers);
}

namespace {

using Names = std::set<std::string>;

// Collects the members of every "extensions" outside extras. The recursion is at most
// limits::kGltfJsonDepthMax deep.
void add_used(const Json& value, Names& names) {
  cancel_point();
  if (value.is_array()) {
    for (const Json& element : value) add_used(element, names);
  }
  if (!value.is_object()) return;
  for (const auto& [key, member] : value.items()) {
    if (key == "extras") continue;
    if (key == "extensions" && member.is_object()) {
      for (const auto& [extension, unused] : member.items()) names.insert(extension);
    }
    add_used(member, names);
  }
}

// Reads the document, and the names of all extensions that it lists or uses.
Status read_members(std::string_view name, Json& root, bool with_animations, Document& to,
                    Names& extensions) {
  std::vector<std::string> used, required;
  std::vector<VariantName> variants;
  JsonReading reading{name, root};
  JsonObject o(reading, root);
  o.optional("accessors", to.accessors);
  o.optional("bufferViews", to.views);
  o.optional("buffers", to.buffers);
  o.optional("extensions", [&](JsonObject by_name) {
    by_name.optional(kVariants, [&](JsonObject by) { by.required("variants", variants); });
  });
  o.optional("extensionsRequired", required);
  o.optional("extensionsUsed", used);
  o.optional("images", to.images);
  o.optional("materials", to.materials);
  o.optional("meshes", to.meshes);
  o.optional("nodes", to.nodes);
  o.optional("samplers", to.samplers);
  o.optional("scene", to.scene, "scenes");
  o.optional("scenes", to.scenes);
  o.optional("skins", to.skins);
  o.optional("textures", to.textures);
  to.has_animations = o.has("animations") && !root["animations"].empty();
  if (with_animations) o.optional("animations", to.animations);
  if (reading.error) return *std::move(reading.error);
  for (VariantName& variant : variants) to.variants.push_back(std::move(variant.name));
  extensions.insert(used.begin(), used.end());
  extensions.insert(required.begin(), required.end());
  add_used(root, extensions);
  return {};
}

bool is_version_2(std::string_view version) {
  int major = 0;
  const char* last = version.data() + version.size();
  const auto [end, error] = std::from_chars(version.data(), last, major);
  return error == std::errc() && major == 2 && (end == last || *end == '.');
}

// Checks asset.version and the extensions that the file requires, before the rest of the document:
// both may change its meaning. The shape must be complete without the extensions that are not read.
Status check_version(std::string_view name, const Json& root) {
  const auto asset = root.find("asset");
  const auto text_of = [&](const char* key) -> const std::string* {
    if (asset == root.end() || !asset->is_object() || !asset->contains(key)) return nullptr;
    return asset->at(key).get_ptr<const std::string*>();
  };
  const auto unsupported = [&](const char* key, const std::string& text) {
    return Error{ErrorCode::kUnsupportedFeature,
                 std::string(name) + " asset." + key + ": version of glTF", "2.0", shown(text)};
  };
  const std::string *version = text_of("version"), *min_version = text_of("minVersion");
  if (version == nullptr) {
    return malformed_mesh(name, "asset.version", "the file does not say its version", "\"2.0\"",
                          "nothing");
  }
  if (!is_version_2(*version)) return unsupported("version", *version);
  if (min_version != nullptr && *min_version != "2.0") {
    return unsupported("minVersion", *min_version);
  }
  const auto required = root.find("extensionsRequired");
  if (required == root.end() || !required->is_array()) return {};
  for (const Json& extension : *required) {
    if (!extension.is_string()) continue;
    const auto& text = extension.get_ref<const std::string&>();
    if (is_read_extension(text) || is_texture_extension(text)) continue;
    return Error{ErrorCode::kUnsupportedFeature,
                 std::string(name) + ": the file requires the glTF extension " + shown(text),
                 "extensions that voxeld reads: " + std::string(kReadExtensions), shown(text)};
  }
  return {};
}

// Completes the nodes by what their lists of children say. Errors: malformed-mesh for a node with
// two parents, a cycle, or a tree deeper than limits::kGltfNodeDepthMax.
Status walk_nodes(Document& document) {
  std::vector<Node>& nodes = document.nodes;
  for (size_t i = 0; i < nodes.size(); ++i) {
    cancel_point();
    for (const int child : nodes[i].children) {
      int& parent = nodes[child].parent;
      if (parent >= 0) {
        return document.malformed(at_index("nodes", child), "the node has two parents", "a tree",
                                  at_index("nodes", parent) + " and " + at_index("nodes", i));
      }
      parent = static_cast<int>(i);
    }
  }
  // A document without scenes shows all.
  for (Node& node : nodes) node.is_shown = document.scenes.empty();
  if (!document.scenes.empty()) {
    for (const int node : document.scenes[document.scene].nodes) nodes[node].is_shown = true;
  }
  std::vector<int> stack, depths(nodes.size());
  for (int i = static_cast<int>(nodes.size()); i-- > 0;) {
    if (nodes[i].parent < 0) stack.push_back(i);
  }
  while (!stack.empty()) {
    cancel_point();
    const int at = stack.back();
    stack.pop_back();
    Node& node = nodes[at];
    depths[at] = 1;
    node.world_from_node = node.parent_from_node;
    if (node.parent >= 0) {
      const Node& parent = nodes[node.parent];
      depths[at] += depths[node.parent];
      node.world_from_node = parent.world_from_node * node.parent_from_node;
      node.is_shown = node.is_shown || parent.is_shown;
    }
    if (depths[at] > limits::kGltfNodeDepthMax) {
      return over_limit(document.name, at_index("nodes", at), "depth of the node tree",
                        limits::kGltfNodeDepthMax, depths[at]);
    }
    document.order.push_back(at);
    stack.insert(stack.end(), node.children.rbegin(), node.children.rend());
  }
  // Each node has one parent, so nodes that no root reaches are in cycles.
  const auto unreached = std::find(depths.begin(), depths.end(), 0);
  if (unreached == depths.end()) return {};
  return document.malformed(at_index("nodes", unreached - depths.begin()),
                            "the node stands in a cycle", "a tree");
}

}  // namespace

glm::dmat4 Transform::matrix() const {
  glm::dmat4 out = glm::mat4_cast(rotation);
  for (int i = 0; i < 3; ++i) out[i] *= scale[i];
  out[3] = glm::dvec4(translation, 1.0);
  return out;
}

Error Document::malformed(std::string_view where, std::string_view what, std::string expected,
                          std::string got) const {
  return malformed_mesh(name, where, what, std::move(expected), std::move(got));
}

std::string at_index(std::string_view array, size_t index) {
  return std::string(array) + "[" + std::to_string(index) + "]";
}

Result<Document> read_document(std::string_view name, std::string_view json, bool with_animations,
                               Scene& scene) {
  VOXELD_ASSIGN(Json root, parse_json(name, json));
  VOXELD_TRY(check_version(name, root));
  Document document;
  document.name = name;
  Names extensions;
  VOXELD_TRY(read_members(name, root, with_animations, document, extensions));
  free_json(root);
  for (const std::string& extension : extensions) {
    if (is_read_extension(extension)) continue;
    add_warning(scene, "ignored-extension",
                document.name + ": the glTF extension " + shown(extension) + " is not read" +
                    (is_texture_extension(extension) ? "; its textures are left out" : ""));
  }
  VOXELD_TRY(walk_nodes(document));
  return document;
}

}  // namespace voxeld::gltf
