// A glTF document as plain data, reduced to what voxeld uses, with defaults filled in. Types,
// ranges and indices are checked: every index names an existing element, and -1 means none. Byte
// ranges are checked when an accessor is opened (accessor.h).
#pragma once

#include <cstddef>
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

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld::gltf {

// Elements of one array (nodes, accessors, …); an element takes up to some 2 KB of memory. More:
// malformed-mesh.
inline constexpr size_t kArrayElementsMax = 262'144;

struct Buffer {
  uint64_t length_bytes = 0;
  std::optional<std::string> uri;
  // The extension whose views stand for the data; empty: none. Such a buffer may have no bytes.
  std::string fallback_of;
};

// EXT_meshopt_compression: where the data of a view lies as a stream.
struct CompressedView {
  std::string extension;  // or KHR_meshopt_compression
  int buffer = -1;
  uint64_t offset_bytes = 0, length_bytes = 0;
  uint64_t stride_bytes = 0, count = 0;  // of the elements
  std::string mode, filter = "NONE";
};

struct View {
  int buffer = -1;
  uint64_t offset_bytes = 0, length_bytes = 0;
  uint64_t stride_bytes = 0;                 // 0: tightly packed
  std::optional<CompressedView> compressed;  // is read instead of the buffer
};

// Elements of an accessor that replace those of its buffer view, or zeros.
struct Sparse {
  uint64_t count = 0;
  int index_view = -1, value_view = -1;
  uint64_t index_offset_bytes = 0, value_offset_bytes = 0;
  int index_type = 0;  // as Accessor::component_type
};

enum ComponentType { kI8 = 5120, kU8 = 5121, kI16 = 5122, kU16 = 5123, kU32 = 5125, kF32 = 5126 };

struct Accessor {
  int view = -1;  // -1: zeros
  uint64_t offset_bytes = 0;
  uint64_t count = 0;
  int component_type = 0;   // a ComponentType, or a number that is none
  int component_count = 0;  // VEC3: 3, MAT4: 16; 0 for types that voxeld does not read
  bool normalized = false;
  std::optional<Sparse> sparse;
};

struct ImageSource {
  std::string name;
  std::string uri;  // empty: in the buffer view
  int view = -1;
};

struct Sampler {
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

struct Texture {
  int image = -1;             // -1: no image in a format that voxeld reads
  std::string unread_format;  // the extension of an image that voxeld does not read; empty: none
  int sampler = -1;
};

struct TextureTransform {
  glm::dvec2 offset{0.0}, scale{1.0};
  double rotation_rad = 0.0;
};

struct MaterialSource {
  std::string name;
  glm::vec4 base_color{1.0f};  // linear
  bool base_color_given = false;
  // From this alpha on a place is opaque, below it transparent; unset: alphaMode BLEND. OPAQUE, the
  // default, has 0.
  std::optional<double> alpha_cutoff = 0.0;
  int texture = -1;
  int tex_coord = 0;  // N of TEXCOORD_N
  TextureTransform transform;
};

using Attributes = std::map<std::string, int>;  // accessors by name

// KHR_draco_mesh_compression: a stream with the triangles and attributes of a primitive.
struct DracoSource {
  int view = -1;
  std::map<std::string, int> ids;  // of attributes in the stream, by name
};

// KHR_materials_variants: the material of a primitive in some of the document's variants.
struct VariantMaterial {
  std::vector<int> variants;  // not checked: the list of variants may stand behind the meshes
  int material = -1;
};

struct Primitive {
  int mode = 4;
  int indices = -1;  // accessor
  int material = -1;
  Attributes attributes;
  std::vector<Attributes> targets;  // of morphing
  std::optional<DracoSource> draco;
  std::vector<VariantMaterial> variants;
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  std::vector<double> weights;
};

struct Skin {
  int inverse_bind_matrices = -1;  // accessor; -1: identities
  std::vector<int> joints;         // nodes
};

// A transform: scales first, then rotates, then translates.
struct Transform {
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};  // of length 1
  glm::dvec3 scale{1.0};
  glm::dmat4 matrix() const;
};

struct Node {
  std::string name;
  int mesh = -1, skin = -1;
  std::vector<int> children;
  std::vector<double> weights;  // empty: those of the mesh apply
  // EXT_mesh_gpu_instancing: TRANSLATION, ROTATION, SCALE and _COLOR_0 of the copies of the mesh.
  std::optional<Attributes> instances;
  glm::dmat4 parent_from_node{1.0};
  // The parts of parent_from_node, if the file gives no matrix.
  bool has_matrix = false;
  Transform transform;
  int parent = -1;
  glm::dmat4 world_from_node{1.0};
  bool is_shown = false;  // the scene lists the node or one above it
};

struct SceneSource {
  std::vector<int> nodes;
};

struct KeySampler {
  int times = -1, values = -1;  // accessors
  std::string interpolation = "LINEAR";
};

struct ChannelSource {
  uint64_t sampler = 0;  // not checked: the samplers stand behind the channels
  int node = -1;
  std::string path;  // "translation"; extensions add others
};

struct AnimationSource {
  std::string name;
  std::vector<ChannelSource> channels;
  std::vector<KeySampler> samplers;
};

struct Document {
  std::string name;  // of the file, for errors
  std::vector<Buffer> buffers;
  std::vector<View> views;
  std::vector<Accessor> accessors;
  std::vector<ImageSource> images;
  std::vector<Sampler> samplers;
  std::vector<Texture> textures;
  std::vector<MaterialSource> materials;
  std::vector<std::string> variants;  // names, of the materials
  std::vector<Mesh> meshes;
  std::vector<Skin> skins;
  std::vector<Node> nodes;
  std::vector<int> order;  // every node, parents before children
  std::vector<SceneSource> scenes;
  int scene = 0;  // the default scene; the first where the file names none
  bool has_animations = false;
  std::vector<AnimationSource> animations;  // empty unless they were asked for

  // malformed-mesh with the detail "<name> <where>: <what>".
  Error malformed(std::string_view where, std::string_view what, std::string expected = {},
                  std::string got = {}) const;
};

// "nodes[3]": the place of an element, as errors name it.
std::string at_index(std::string_view array, size_t index);

// Reads the JSON of a glTF file. A scan bounds depth (limits::kGltfJsonDepthMax) and number of
// values before it is parsed, so hostile text can exhaust neither stack nor memory. Animations are
// checked and read only on request, because a scene that stands still does not need them. Adds the
// warning "ignored-extension" for each extension that is not read, whether the file lists it or
// only uses it.
//
// Errors: malformed-mesh with the byte or the path ("accessors[3].bufferView");
// unsupported-feature for another version of glTF, and for an extension that the file requires.
Result<Document> read_document(std::string_view name, std::string_view json, bool with_animations,
                               Scene& scene);

}  // namespace voxeld::gltf
