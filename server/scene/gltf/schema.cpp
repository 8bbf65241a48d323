// The part of the glTF 2.0 schema that voxeld reads, as tables. Later steps read without checks, so
// every type, range and index that they rely on must be listed here.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "proto/range_text.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/json.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

enum class Kind {
  kBool,
  kString,
  kStrings,
  kType,  // of an accessor's elements
  kNumber,
  kNumbers,   // array of numbers
  kSize,      // integer in [0, 2^53]; 1.0 is one
  kStride,    // 0, or a multiple of 4 up to 252
  kIndex,     // of an existing element of the top-level array `target`
  kIndices,   // array of indices
  kIndexMap,  // object whose values are such indices
  kIndexMaps,
  kObject,
  kObjects,  // array of objects
};

enum Presence { kOptional, kRequired };

struct Rule {
  const char* key;
  Kind kind;
  const char* target = nullptr;        // of kIndex, kIndices, kIndexMap
  std::span<const Rule> members = {};  // of kObject, kObjects
  Presence presence = kOptional;
};

constexpr Rule kSparseIndices[] = {{"bufferView", Kind::kIndex, "bufferViews", {}, kRequired},
                                   {"byteOffset", Kind::kSize},
                                   {"componentType", Kind::kSize, nullptr, {}, kRequired}};
constexpr Rule kSparseValues[] = {{"bufferView", Kind::kIndex, "bufferViews", {}, kRequired},
                                  {"byteOffset", Kind::kSize}};
constexpr Rule kSparse[] = {{"count", Kind::kSize, nullptr, {}, kRequired},
                            {"indices", Kind::kObject, nullptr, kSparseIndices, kRequired},
                            {"values", Kind::kObject, nullptr, kSparseValues, kRequired}};
constexpr Rule kAccessor[] = {{"bufferView", Kind::kIndex, "bufferViews"},
                              {"byteOffset", Kind::kSize},
                              {"componentType", Kind::kSize, nullptr, {}, kRequired},
                              {"count", Kind::kSize, nullptr, {}, kRequired},
                              {"normalized", Kind::kBool},
                              {"sparse", Kind::kObject, nullptr, kSparse},
                              {"type", Kind::kType, nullptr, {}, kRequired}};
constexpr Rule kBufferExtensions[] = {{"EXT_meshopt_compression", Kind::kObject},
                                      {"KHR_meshopt_compression", Kind::kObject}};
constexpr Rule kBuffer[] = {{"byteLength", Kind::kSize, nullptr, {}, kRequired},
                            {"extensions", Kind::kObject, nullptr, kBufferExtensions},
                            {"uri", Kind::kString}};
constexpr Rule kBufferView[] = {{"buffer", Kind::kIndex, "buffers", {}, kRequired},
                                {"byteLength", Kind::kSize, nullptr, {}, kRequired},
                                {"byteOffset", Kind::kSize},
                                {"byteStride", Kind::kStride}};
constexpr Rule kImage[] = {
    {"bufferView", Kind::kIndex, "bufferViews"}, {"name", Kind::kString}, {"uri", Kind::kString}};
constexpr Rule kWebp[] = {{"source", Kind::kIndex, "images"}};
constexpr Rule kTextureExtensions[] = {{"EXT_texture_webp", Kind::kObject, nullptr, kWebp}};
constexpr Rule kPrimitiveExtensions[] = {{"KHR_draco_mesh_compression", Kind::kObject}};
constexpr Rule kTexture[] = {{"extensions", Kind::kObject, nullptr, kTextureExtensions},
                             {"sampler", Kind::kIndex, "samplers"},
                             {"source", Kind::kIndex, "images"}};
constexpr Rule kSampler[] = {{"wrapS", Kind::kSize}, {"wrapT", Kind::kSize}};
constexpr Rule kTextureTransform[] = {{"offset", Kind::kNumbers},
                                      {"rotation", Kind::kNumber},
                                      {"scale", Kind::kNumbers},
                                      {"texCoord", Kind::kSize}};
constexpr Rule kInfoExtensions[] = {
    {"KHR_texture_transform", Kind::kObject, nullptr, kTextureTransform}};
constexpr Rule kTextureInfo[] = {{"extensions", Kind::kObject, nullptr, kInfoExtensions},
                                 {"index", Kind::kIndex, "textures", {}, kRequired},
                                 {"texCoord", Kind::kSize}};
constexpr Rule kPbr[] = {{"baseColorFactor", Kind::kNumbers},
                         {"baseColorTexture", Kind::kObject, nullptr, kTextureInfo}};
constexpr Rule kSpecularGlossiness[] = {{"diffuseFactor", Kind::kNumbers},
                                        {"diffuseTexture", Kind::kObject, nullptr, kTextureInfo}};
constexpr Rule kMaterialExtensions[] = {
    {"KHR_materials_pbrSpecularGlossiness", Kind::kObject, nullptr, kSpecularGlossiness}};
constexpr Rule kMaterial[] = {{"extensions", Kind::kObject, nullptr, kMaterialExtensions},
                              {"name", Kind::kString},
                              {"pbrMetallicRoughness", Kind::kObject, nullptr, kPbr}};
constexpr Rule kPrimitive[] = {{"attributes", Kind::kIndexMap, "accessors", {}, kRequired},
                               {"extensions", Kind::kObject, nullptr, kPrimitiveExtensions},
                               {"indices", Kind::kIndex, "accessors"},
                               {"material", Kind::kIndex, "materials"},
                               {"mode", Kind::kSize},
                               {"targets", Kind::kIndexMaps, "accessors"}};
constexpr Rule kMesh[] = {{"name", Kind::kString},
                          {"primitives", Kind::kObjects, nullptr, kPrimitive, kRequired},
                          {"weights", Kind::kNumbers}};
constexpr Rule kNode[] = {{"children", Kind::kIndices, "nodes"},
                          {"matrix", Kind::kNumbers},
                          {"mesh", Kind::kIndex, "meshes"},
                          {"name", Kind::kString},
                          {"rotation", Kind::kNumbers},
                          {"scale", Kind::kNumbers},
                          {"skin", Kind::kIndex, "skins"},
                          {"translation", Kind::kNumbers},
                          {"weights", Kind::kNumbers}};
constexpr Rule kScene[] = {{"nodes", Kind::kIndices, "nodes"}};
constexpr Rule kSkin[] = {{"inverseBindMatrices", Kind::kIndex, "accessors"},
                          {"joints", Kind::kIndices, "nodes", {}, kRequired}};
constexpr Rule kRoot[] = {{"accessors", Kind::kObjects, nullptr, kAccessor},
                          {"bufferViews", Kind::kObjects, nullptr, kBufferView},
                          {"buffers", Kind::kObjects, nullptr, kBuffer},
                          {"extensionsRequired", Kind::kStrings},
                          {"extensionsUsed", Kind::kStrings},
                          {"images", Kind::kObjects, nullptr, kImage},
                          {"materials", Kind::kObjects, nullptr, kMaterial},
                          {"meshes", Kind::kObjects, nullptr, kMesh},
                          {"nodes", Kind::kObjects, nullptr, kNode},
                          {"samplers", Kind::kObjects, nullptr, kSampler},
                          {"scene", Kind::kIndex, "scenes"},
                          {"scenes", Kind::kObjects, nullptr, kScene},
                          {"skins", Kind::kObjects, nullptr, kSkin},
                          {"textures", Kind::kObjects, nullptr, kTexture}};

constexpr Rule kChannelTarget[] = {{"node", Kind::kIndex, "nodes"},
                                   {"path", Kind::kString, nullptr, {}, kRequired}};
constexpr Rule kChannel[] = {{"sampler", Kind::kSize, nullptr, {}, kRequired},
                             {"target", Kind::kObject, nullptr, kChannelTarget, kRequired}};
constexpr Rule kKeySampler[] = {{"input", Kind::kIndex, "accessors", {}, kRequired},
                                {"interpolation", Kind::kString},
                                {"output", Kind::kIndex, "accessors", {}, kRequired}};
constexpr Rule kAnimation[] = {{"channels", Kind::kObjects, nullptr, kChannel, kRequired},
                               {"name", Kind::kString},
                               {"samplers", Kind::kObjects, nullptr, kKeySampler, kRequired}};
constexpr Rule kAnimatedRoot[] = {{"animations", Kind::kObjects, nullptr, kAnimation}};

constexpr uint64_t kSizeMax = uint64_t{1} << 53;  // the largest integer that every JSON writer
                                                  // keeps exact

// The value for an error: short scalars in full, otherwise their type.
std::string got_of(const Json& value) {
  if (value.is_string()) return shown(value.get_ref<const std::string&>());
  if (value.is_number() || value.is_boolean()) return value.dump();
  return value.type_name();
}

// An integer in [0, 2^53]; 1.0 and 1e2 are integers too, as in JSON schema.
std::optional<uint64_t> size_of(const Json& value) {
  if (value.is_number_unsigned()) {
    const auto size = value.get<uint64_t>();
    return size <= kSizeMax ? std::optional(size) : std::nullopt;
  }
  if (!value.is_number()) return std::nullopt;
  const auto number = value.get<double>();
  if (!(number >= 0.0 && number <= static_cast<double>(kSizeMax))) return std::nullopt;
  if (number != std::floor(number)) return std::nullopt;
  return static_cast<uint64_t>(number);
}

// The expected value, for an error about an absent one.
std::string_view text_of(const Rule& rule) {
  switch (rule.kind) {
    case Kind::kBool:
      return "true or false";
    case Kind::kString:
    case Kind::kType:
      return "a string";
    case Kind::kNumber:
      return "a number";
    case Kind::kSize:
    case Kind::kStride:
      return "an integer";
    case Kind::kIndex:
      return "an index";
    case Kind::kIndexMap:
    case Kind::kObject:
      return "an object";
    case Kind::kStrings:
    case Kind::kNumbers:
    case Kind::kIndices:
    case Kind::kIndexMaps:
    case Kind::kObjects:
      return "an array";
  }
  return {};
}

// Whether an attribute name is plain. Only hostile files have others.
bool is_word(std::string_view key) {
  return key.size() <= 40 && std::all_of(key.begin(), key.end(), [](char c) {
           return c == '_' || (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                  (c >= 'a' && c <= 'z');
         });
}

// Walks the tree along the tables. The path is built only for an error.
class Checker {
 public:
  Checker(std::string_view name, const Json& root) : name_(name), root_(root) {}

  Status check_object(const Json& object, std::span<const Rule> rules) {
    if (!object.is_object()) return wrong("an object", got_of(object));
    for (const Rule& rule : rules) {
      const auto member = object.find(rule.key);
      path_.emplace_back(rule.key);
      if (member != object.end()) {
        VOXELD_TRY(check_value(*member, rule));
      } else if (rule.presence == kRequired) {
        return malformed_mesh(name_, path(), "is missing", std::string(text_of(rule)), "nothing");
      }
      path_.pop_back();
    }
    return {};
  }

 private:
  Status check_value(const Json& value, const Rule& rule) {
    switch (rule.kind) {
      case Kind::kBool:
        return value.is_boolean() ? Status() : wrong("true or false", got_of(value));
      case Kind::kString:
        return value.is_string() ? Status() : wrong("a string", got_of(value));
      case Kind::kNumber:
        return value.is_number() ? Status() : wrong("a number", got_of(value));
      case Kind::kType:
        return check_type(value);
      case Kind::kSize:
        if (size_of(value)) return {};
        return wrong("an integer from 0 to 2^53", got_of(value));
      case Kind::kStride:
        return check_stride(value);
      case Kind::kIndex:
        return check_index(value, rule.target);
      case Kind::kObject:
        return check_object(value, rule.members);
      case Kind::kIndexMap:
        return check_index_map(value, rule.target);
      case Kind::kStrings:
      case Kind::kNumbers:
      case Kind::kIndices:
      case Kind::kIndexMaps:
      case Kind::kObjects:
        return check_array(value, rule);
    }
    return {};
  }

  static Kind element_kind(Kind array) {
    switch (array) {
      case Kind::kStrings:
        return Kind::kString;
      case Kind::kNumbers:
        return Kind::kNumber;
      case Kind::kIndices:
        return Kind::kIndex;
      case Kind::kIndexMaps:
        return Kind::kIndexMap;
      default:
        return Kind::kObject;
    }
  }

  Status check_array(const Json& value, const Rule& rule) {
    if (!value.is_array()) return wrong("an array", got_of(value));
    if (value.size() > kGltfObjectsMax) {
      return over_limit(name_, path(), "elements", static_cast<int64_t>(kGltfObjectsMax),
                        static_cast<int64_t>(value.size()));
    }
    Rule element = rule;
    element.kind = element_kind(rule.kind);
    for (size_t i = 0; i < value.size(); ++i) {
      path_.emplace_back(i);
      VOXELD_TRY(check_value(value[i], element));
      path_.pop_back();
    }
    return {};
  }

  Status check_index_map(const Json& value, const char* target) {
    if (!value.is_object()) return wrong("an object", got_of(value));
    for (const auto& [key, index] : value.items()) {
      path_.emplace_back(key.c_str());
      VOXELD_TRY(check_index(index, target));
      path_.pop_back();
    }
    return {};
  }

  Status check_type(const Json& value) {
    if (value.is_string() && gltf_component_count(value.get_ref<const std::string&>())) return {};
    return wrong("SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4", got_of(value));
  }

  Status check_stride(const Json& value) {
    const auto stride = size_of(value);
    if (stride && *stride % 4 == 0 && *stride <= 252) return {};
    return wrong("a multiple of 4 from 4 to 252", got_of(value));
  }

  Status check_index(const Json& value, const char* target) {
    const auto array = root_.find(target);
    const size_t count = array != root_.end() && array->is_array() ? array->size() : 0;
    const auto index = size_of(value);
    if (index && *index < count) return {};
    if (count == 0) return wrong(index_text(0, target), got_of(value));
    return wrong("an index of one of " + std::to_string(count) + " " + target, got_of(value));
  }

  Error wrong(std::string expected, std::string got) const {
    return malformed_mesh(name_, path(), "wrong value", std::move(expected), std::move(got));
  }

  std::string path() const {
    std::string text;
    for (const auto& step : path_) {
      if (const auto* index = std::get_if<size_t>(&step)) {
        text += "[" + std::to_string(*index) + "]";
      } else {
        const std::string_view key = std::get<const char*>(step);
        text.append(text.empty() ? "" : ".").append(is_word(key) ? std::string(key) : shown(key));
      }
    }
    return text;
  }

  std::string_view name_;
  const Json& root_;
  std::vector<std::variant<const char*, size_t>> path_;
};

}  // namespace

Status check_gltf_schema(std::string_view name, const nlohmann::json& document) {
  return Checker(name, document).check_object(document, kRoot);
}

Status check_gltf_animation_schema(std::string_view name, const nlohmann::json& document) {
  return Checker(name, document).check_object(document, kAnimatedRoot);
}

}  // namespace voxeld
