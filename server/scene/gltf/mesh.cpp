#include "server/scene/gltf/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/name_list.h"
#include "server/scene/core/normals.h"
#include "server/scene/core/vertex_table.h"
#include "server/scene/gltf/instances.h"

namespace voxeld::gltf {
namespace {

enum Mode { kTriangles = 4, kStrip = 5, kFan = 6 };
constexpr int kInfluenceSetsMax = 4;  // JOINTS_0 to JOINTS_3; real files have at most two

// The open accessors of one primitive on one node.
struct VertexSource {
  struct Target {
    uint32_t number = 0;
    double weight = 0.0;
    std::optional<Elements> position = {}, normal = {};
  };
  struct Influences {  // JOINTS_n and WEIGHTS_n
    Elements joints, weights;
  };
  std::string path;  // "meshes[0].primitives[1]"
  Elements position;
  std::optional<Elements> normal, uv, color;
  TextureTransform uv_transform;
  std::vector<Target> targets;
  std::vector<Influences> influences;
  size_t joint_count = 0;
  std::optional<glm::vec4> copy_color;       // of the copy of the mesh that is read
  float base_alpha = 1.0f;                   // of the material
  std::optional<double> alpha_cutoff = 0.0;  // likewise
  // Indices of the rig's matrices and weights.
  uint32_t node_matrix = 0, first_joint_matrix = 0, first_weight = 0;

  bool has_color() const { return color || copy_color; }
};

// How often a node shows its mesh, and with which matrices of the rig.
struct Copies {
  uint32_t first_matrix = 0;
  size_t count = 1;
  std::vector<glm::vec4> colors;  // empty: none
};

// The matrices that a vertex follows: those of its joints with a weight above 0, or that of its
// node. Weights are divided by their sum, although glTF 2.0, 3.7.3.3 asks writers for a sum of 1.
struct VertexMatrices {
  std::array<Influence, size_t{4} * kInfluenceSetsMax> influences;
  size_t count = 0;
  double weight_sum = 0.0;

  std::span<const Influence> used() const { return std::span(influences).first(count); }
  void add(uint32_t matrix, double weight) {
    influences[count++] = {matrix, weight};
    weight_sum += weight;
  }
};

float finite_float(double x) {
  return is_coordinate(x) ? static_cast<float>(x) : 0.0f;
}

// Applies KHR_texture_transform to a texture coordinate whose origin is the top left. The
// specification's rotation appears counter-clockwise with v downwards. Its example (offset 0 1,
// rotation 90 degrees, scale 0.5) must land in the lower left quarter of the image.
glm::vec2 transformed_uv(const TextureTransform& transform, const glm::dvec2& uv) {
  const double c = std::cos(transform.rotation_rad), s = std::sin(transform.rotation_rad);
  const glm::dvec2 scaled = transform.scale * uv;
  return {finite_float(c * scaled.x + s * scaled.y + transform.offset.x),
          finite_float(-s * scaled.x + c * scaled.y + transform.offset.y)};
}

// Reads vertices of primitives in world space: morphed, skinned, transformed.
class Vertices {
 public:
  Vertices(const Document& document, Accessors& accessors, RigBuilder& rig)
      : document_(document), accessors_(accessors), rig_(rig) {}

  // Opens a primitive with positions.
  Result<VertexSource> open(int node_index, const Primitive& primitive, const std::string& path) {
    VertexSource source;
    source.path = path;
    VOXELD_ASSIGN(source.position, accessors_.open(primitive.attributes.at("POSITION"),
                                                   {"POSITION", 3, 3, Expected::kFloatOrSmall}));
    VOXELD_ASSIGN(source.normal, open_attribute(primitive.attributes, "NORMAL", 3, 3, source));
    VOXELD_ASSIGN(source.color, open_attribute(primitive.attributes, "COLOR_0", 3, 4, source));
    if (primitive.material >= 0) {
      const auto& material = document_.materials[primitive.material];
      source.base_alpha = material.base_color.a;
      source.alpha_cutoff = material.alpha_cutoff;
      if (material.texture >= 0) {
        const std::string key = "TEXCOORD_" + std::to_string(material.tex_coord);
        VOXELD_ASSIGN(source.uv, open_attribute(primitive.attributes, key, 2, 2, source));
        source.uv_transform = material.transform;
      }
    }
    VOXELD_TRY(open_targets(node_index, primitive, source));
    VOXELD_TRY(open_skin(document_.nodes[node_index].skin, primitive, source));
    return source;
  }

  // Appends vertex `index` < source.position.count to every attribute of the part, and to `skin`,
  // the part's table in the rig (null if the rig is not recorded).
  Status append(const VertexSource& source, uint32_t index, MeshPart& part, SkinPart* skin) const {
    glm::dvec3 position(source.position.vector(index));
    glm::dvec3 normal(source.normal ? source.normal->vector(index) : glm::dvec4(0.0));
    for (const VertexSource::Target& target : source.targets) {
      if (target.position) position += target.weight * glm::dvec3(target.position->vector(index));
      if (target.normal) normal += target.weight * glm::dvec3(target.normal->vector(index));
    }
    VOXELD_ASSIGN(const VertexMatrices matrices, matrices_of(source, index));
    const glm::dmat4 world_from_mesh = blended(matrices);
    position = glm::dvec3(world_from_mesh * glm::dvec4(position, 1.0));
    if (!is_coordinate(position.x) || !is_coordinate(position.y) || !is_coordinate(position.z)) {
      return document_.malformed(source.path + ".attributes.POSITION",
                                 "vertex " + std::to_string(index) + " is at no finite place",
                                 "coordinates of at most 1e30 in size");
    }
    if (skin != nullptr) VOXELD_TRY(append_to_rig(source, matrices, index, *skin));
    push_in_pieces(part.positions, position);
    if (source.normal) {
      push_in_pieces(part.normals, direction_of(world_normal(world_from_mesh, normal)));
    }
    if (source.uv) {
      push_in_pieces(part.uvs,
                     transformed_uv(source.uv_transform, glm::dvec2(source.uv->vector(index))));
    }
    if (source.has_color()) push_in_pieces(part.colors, color_of(source, index));
    return {};
  }

  // Whether the transform of a vertex mirrors, which reverses the orientation of triangles.
  Result<bool> is_mirrored(const VertexSource& source, uint32_t index) const {
    VOXELD_ASSIGN(const VertexMatrices matrices, matrices_of(source, index));
    return glm::determinant(glm::dmat3(blended(matrices))) < 0.0;
  }

 private:
  static glm::vec4 color_of(const VertexSource& source, uint32_t index) {
    glm::vec4 color(1.0f);
    if (source.color) color = glm::vec4(source.color->vector(index, Scaling::kAlways));
    if (source.color && source.color->component_count == 3) color.a = 1.0f;
    color = {unit_clamped(color.r), unit_clamped(color.g), unit_clamped(color.b),
             unit_clamped(color.a)};
    if (source.copy_color) color *= *source.copy_color;
    if (source.alpha_cutoff) {
      color.a = double{color.a} * source.base_alpha >= *source.alpha_cutoff ? 1.0f : 0.0f;
    }
    return color;
  }

  Result<std::optional<Elements>> open_attribute(const Attributes& attributes,
                                                 const std::string& key, int components_min,
                                                 int components_max, const VertexSource& source) {
    const auto found = attributes.find(key);
    if (found == attributes.end()) return std::optional<Elements>();
    VOXELD_ASSIGN(const Elements elements,
                  accessors_.open(found->second,
                                  {key, components_min, components_max, Expected::kFloatOrSmall}));
    if (elements.count == source.position.count) return std::optional(elements);
    return document_.malformed(source.path + "." + key, "elements of the attribute",
                               std::to_string(source.position.count) + " as POSITION",
                               std::to_string(elements.count));
  }

  Status open_targets(int node_index, const Primitive& primitive, VertexSource& source) {
    const Node& node = document_.nodes[node_index];
    const Mesh& mesh = document_.meshes[node.mesh];
    const std::vector<double>& weights = node.weights.empty() ? mesh.weights : node.weights;
    if (rig_.is_recorded() && !primitive.targets.empty()) {
      // All primitives of a mesh should have the same number of targets. The most counts.
      size_t count = 0;
      for (const Primitive& other : mesh.primitives) count = std::max(count, other.targets.size());
      VOXELD_ASSIGN(source.first_weight, rig_.first_weight_of_node(node_index, weights, count));
    }
    for (size_t i = 0; i < primitive.targets.size(); ++i) {
      const double weight = i < weights.size() ? weights[i] : 0.0;
      if (weight == 0.0 && !rig_.is_recorded()) continue;
      VertexSource::Target target{.number = static_cast<uint32_t>(i), .weight = weight};
      const Attributes& attributes = primitive.targets[i];
      VOXELD_ASSIGN(target.position, open_attribute(attributes, "POSITION", 3, 3, source));
      VOXELD_ASSIGN(target.normal, open_attribute(attributes, "NORMAL", 3, 3, source));
      source.targets.push_back(target);
    }
    return {};
  }

  // Opens a skin; -1: none. Only its joints place a skinned mesh (glTF 2.0, 3.7.3.1).
  Status open_skin(int skin, const Primitive& primitive, VertexSource& source) {
    if (skin < 0) return {};
    for (int set = 0; set < kInfluenceSetsMax; ++set) {
      const std::string number = std::to_string(set);
      VOXELD_ASSIGN(const auto joints,
                    open_attribute(primitive.attributes, "JOINTS_" + number, 4, 4, source));
      VOXELD_ASSIGN(const auto weights,
                    open_attribute(primitive.attributes, "WEIGHTS_" + number, 4, 4, source));
      if (!joints || !weights) break;
      source.influences.push_back({*joints, *weights});
    }
    if (source.influences.empty()) return {};
    source.joint_count = document_.skins[skin].joints.size();
    VOXELD_ASSIGN(source.first_joint_matrix, rig_.first_matrix_of_skin(skin));
    return {};
  }

  Result<VertexMatrices> matrices_of(const VertexSource& source, uint32_t index) const {
    VertexMatrices out;
    for (const auto& [joints, weights] : source.influences) {
      const glm::dvec4 joint = joints.vector(index);
      const glm::dvec4 weight = weights.vector(index, Scaling::kAlways);
      for (int i = 0; i < 4; ++i) {
        if (!(weight[i] > 0.0) || !is_coordinate(weight[i])) continue;
        if (!(joint[i] >= 0.0 && joint[i] < static_cast<double>(source.joint_count))) {
          return document_.malformed(
              source.path + ".JOINTS", "joint out of range",
              index_text(source.joint_count, "joints"),
              std::to_string(joint[i]) + " at vertex " + std::to_string(index));
        }
        out.add(source.first_joint_matrix + static_cast<uint32_t>(joint[i]), weight[i]);
      }
    }
    if (out.count == 0) out.add(source.node_matrix, 1.0);
    return out;
  }

  glm::dmat4 blended(const VertexMatrices& matrices) const {
    if (matrices.count == 1) return rig_.world_from_bound(matrices.influences[0].matrix);
    glm::dmat4 sum(0.0);
    for (const auto& [matrix, weight] : matrices.used()) {
      sum += weight * rig_.world_from_bound(matrix);
    }
    return sum / matrices.weight_sum;
  }

  Status append_to_rig(const VertexSource& source, const VertexMatrices& matrices, uint32_t index,
                       SkinPart& skin) const {
    push_in_pieces(skin.points, glm::dvec3(source.position.vector(index)));
    push_in_pieces(skin.normals,
                   glm::vec3(source.normal ? source.normal->vector(index) : glm::dvec4(0.0)));
    for (const auto& [matrix, weight] : matrices.used()) {
      push_in_pieces(skin.influences, {matrix, weight / matrices.weight_sum});
    }
    for (const VertexSource::Target& target : source.targets) {
      MorphDelta delta{.weight = source.first_weight + target.number};
      if (target.position) delta.position = glm::vec3(target.position->vector(index));
      if (target.normal) delta.normal = glm::vec3(target.normal->vector(index));
      if (delta.position == glm::vec3(0.0f) && delta.normal == glm::vec3(0.0f)) continue;
      push_in_pieces(skin.morphs, delta);
    }
    return rig_.end_vertex(skin);
  }

  const Document& document_;
  Accessors& accessors_;
  RigBuilder& rig_;
};

// Renumbers the vertices of a file in the order of their first use. It uses a plain array if most
// are used, and a hash table if a primitive uses few of many.
class Renumbering {
 public:
  Renumbering(uint64_t vertex_count, size_t corner_count)
      : is_dense_(vertex_count <= 8 * static_cast<uint64_t>(corner_count) + 1024) {
    if (is_dense_) resize_in_pieces(dense_, vertex_count, kNone);
  }
  // The number of `vertex`, or `next` if it has none yet; second: whether it is new.
  std::pair<uint32_t, bool> number_of(uint32_t vertex, uint32_t next) {
    if (!is_dense_) return table_.find_or_add({vertex, 0, 0, 0}, next);
    uint32_t& number = dense_[vertex];
    if (number != kNone) return {number, false};
    number = next;
    return {next, true};
  }

 private:
  static constexpr uint32_t kNone = UINT32_MAX;
  bool is_dense_;
  std::vector<uint32_t> dense_;
  VertexTable table_;
};

class MeshLoader {
 public:
  MeshLoader(const Document& document, Accessors& accessors, Textures& textures, Scene& scene,
             RigBuilder& rig)
      : document_(document),
        accessors_(accessors),
        textures_(textures),
        scene_(scene),
        rig_(rig),
        vertices_(document, accessors, rig),
        meshes_(scene.meshes),
        nodes_(scene.nodes),
        groups_(scene.groups) {}

  // Adds the node's mesh, if it has one.
  Status add_node(int node) {
    const int mesh = document_.nodes[node].mesh;
    if (mesh < 0) return {};
    const auto& primitives = document_.meshes[mesh].primitives;
    VOXELD_ASSIGN(const Copies copies, copies_of(node));
    for (size_t i = 0; i < primitives.size(); ++i) {
      if (primitives[i].mode < kTriangles) {
        ++flat_primitive_count_;
      } else if (!primitives[i].attributes.contains("POSITION")) {
        // glTF 2.0, 3.7.2.1: a client should skip it. Extensions may hold its shape.
        ++bare_primitive_count_;
      } else {
        VOXELD_TRY(add_primitive(node, mesh, i, copies));
      }
    }
    return {};
  }

  // Adds the warnings about what was left out. Errors: empty-mesh.
  Status finish() {
    std::string skipped;
    for (const auto& [count, kind] :
         {std::pair(flat_primitive_count_, " primitives of points or lines"),
          std::pair(bare_primitive_count_, " primitives without POSITION")}) {
      if (count > 0) skipped += (skipped.empty() ? "" : ", ") + std::to_string(count) + kind;
    }
    if (!skipped.empty()) {
      add_warning(scene_, "skipped-primitive", document_.name + ": " + skipped + " were left out");
    }
    if (incomplete_count_ > 0) {
      add_warning(scene_, "incomplete-triangle",
                  document_.name + ": the last corners of " + std::to_string(incomplete_count_) +
                      " primitives (first: " + first_incomplete_ +
                      ") are no triangle; they were left out");
    }
    if (scene_.triangle_count() > 0) return {};
    if (skipped.empty() && incomplete_count_ > 0) skipped = "no whole triangle";
    return empty_mesh(document_.name,
                      skipped.empty() ? "no node with a mesh in the scene" : skipped);
  }

 private:
  // A mesh with a skin has the place that its joints give it, so there is one.
  Result<Copies> copies_of(int index) {
    const Node& node = document_.nodes[index];
    Copies copies;
    if (node.instances && node.skin >= 0) {
      add_warning(scene_, "ignored-extension",
                  document_.name + " " + at_index("nodes", index) +
                      ": EXT_mesh_gpu_instancing of a mesh with a skin is left out: there is one");
    }
    if (!node.instances || node.skin >= 0) {
      copies.first_matrix = rig_.matrix_of_node(index);
      return copies;
    }
    VOXELD_ASSIGN(Instances instances, read_instances(document_, accessors_, index));
    copies.count = instances.node_from_instance.size();
    copies.colors = std::move(instances.colors);
    VOXELD_ASSIGN(copies.first_matrix,
                  rig_.first_matrix_of_instances(index, instances.node_from_instance));
    return copies;
  }

  Status add_primitive(int node, int mesh, size_t index, const Copies& copies) {
    const Primitive& primitive = document_.meshes[mesh].primitives[index];
    const std::string path = at_index(at_index("meshes", mesh) + ".primitives", index);
    VOXELD_TRY(accessors_.decode(primitive, path));
    VOXELD_ASSIGN(VertexSource source, vertices_.open(node, primitive, path));
    VOXELD_ASSIGN(const std::vector<uint32_t> corners,
                  triangles_of(primitive, path, source.position.count, copies.count));
    if (corners.empty() || copies.count == 0) return {};
    if (!copies.colors.empty()) source.copy_color = copies.colors[0];
    const int material = textures_.use_material(primitive.material);
    MeshPart& part = part_for(node, index, material, source);
    if (material >= 0 && scene_.materials[material].image >= 0 && !source.uv) {
      add_warning(scene_, "no-texture-coordinates",
                  document_.name + " " + path + ": has no coordinates for its texture");
    }
    const size_t first_corner = part.indices.size();
    // A part that many primitives share grows on its own: each reserve() would copy it.
    if (part.indices.empty()) part.indices.reserve(corners.size() * copies.count);
    for (size_t i = 0; i < copies.count; ++i) {
      source.node_matrix = copies.first_matrix + static_cast<uint32_t>(i);
      if (!copies.colors.empty()) source.copy_color = copies.colors[i];
      VOXELD_TRY(add_copy(source, corners, part));
    }
    repair_normals(part.positions, std::span(part.indices).subspan(first_corner), part.normals);
    return {};
  }

  Status add_copy(const VertexSource& source, const std::vector<uint32_t>& corners,
                  MeshPart& part) {
    VOXELD_ASSIGN(const bool is_mirrored, vertices_.is_mirrored(source, corners[0]));
    const size_t first_corner = part.indices.size();
    VOXELD_TRY(add_corners(source, corners, part));
    for (size_t i = first_corner; i + 2 < part.indices.size() && is_mirrored; i += 3) {
      cancel_point();
      std::swap(part.indices[i + 1], part.indices[i + 2]);
    }
    return {};
  }

  Status add_corners(const VertexSource& source, const std::vector<uint32_t>& corners,
                     MeshPart& part) {
    SkinPart* skin = rig_.is_recorded() ? &rig_.part(&part - scene_.parts.data()) : nullptr;
    Renumbering renumbering(source.position.count, corners.size());
    for (const uint32_t corner : corners) {
      cancel_point();
      const auto next = static_cast<uint32_t>(part.positions.size());
      const auto [number, is_new] = renumbering.number_of(corner, next);
      push_in_pieces(part.indices, number);
      if (!is_new) continue;
      if (++vertex_count_ > limits::kVerticesMax) {
        return over_limit(document_.name, source.path, "vertices of the scene",
                          limits::kVerticesMax, vertex_count_);
      }
      VOXELD_TRY(vertices_.append(source, corner, part, skin));
    }
    return {};
  }

  // Vertex numbers of the file, 3 per triangle, of one of `copy_count` copies.
  Result<std::vector<uint32_t>> triangles_of(const Primitive& primitive, const std::string& path,
                                             uint64_t vertex_count, size_t copy_count) {
    std::optional<Elements> indices;
    if (primitive.indices >= 0) {
      VOXELD_ASSIGN(indices,
                    accessors_.open(primitive.indices, {"indices", 1, 1, Expected::kUnsigned}));
    }
    const uint64_t corner_count = indices ? indices->count : vertex_count;
    VOXELD_ASSIGN(const uint64_t count,
                  count_triangles(primitive.mode, corner_count, copy_count, path));
    std::vector<uint32_t> corners;
    corners.reserve(3 * count);
    const auto add = [&](uint64_t a, uint64_t b, uint64_t c) {
      const auto at = [&](uint64_t k) {
        return indices ? indices->index(k) : static_cast<uint32_t>(k);
      };
      const uint32_t triangle[3] = {at(a), at(b), at(c)};
      // Strips repeat corners to turn or to jump; such bridges are no faces.
      const bool is_bridge =
          primitive.mode == kStrip &&
          (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]);
      if (!is_bridge) corners.insert(corners.end(), triangle, triangle + 3);
    };
    for (uint64_t i = 0; i < count; ++i) {  // glTF 2.0, 3.7.2.1
      cancel_point();
      if (primitive.mode == kTriangles) add(3 * i, 3 * i + 1, 3 * i + 2);
      if (primitive.mode == kStrip) add(i, i + 1 + i % 2, i + 2 - i % 2);
      if (primitive.mode == kFan) add(i + 1, i + 2, 0);
    }
    for (const uint32_t corner : corners) {
      cancel_point();
      if (corner < vertex_count) continue;
      return document_.malformed(path + ".indices", "index out of range",
                                 index_text(vertex_count, "vertices"), std::to_string(corner));
    }
    return corners;
  }

  // Triangles of one copy.
  Result<uint64_t> count_triangles(int mode, uint64_t corner_count, size_t copy_count,
                                   const std::string& path) {
    if (mode > kFan) {
      return document_.malformed(path + ".mode", "unknown mode", "0 to 6", std::to_string(mode));
    }
    const uint64_t left_over =
        mode == kTriangles ? corner_count % 3 : (corner_count < 3 ? corner_count : 0);
    if (left_over > 0 && incomplete_count_++ == 0) {
      first_incomplete_ = path + ", " + std::to_string(corner_count) + " corners";
    }
    const uint64_t count =
        mode == kTriangles ? corner_count / 3 : (corner_count < 3 ? 0 : corner_count - 2);
    triangle_count_ += static_cast<int64_t>(count * copy_count);  // below 2^50
    if (triangle_count_ <= limits::kTrianglesMax) return count;
    return over_limit(document_.name, path, "triangles of the scene", limits::kTrianglesMax,
                      triangle_count_);
  }

  // Returns a new part, or, in a full scene, the last one with the same material and attributes. An
  // unnamed mesh or node is named by its place in the file, as in errors.
  MeshPart& part_for(int node_index, size_t index, int material, const VertexSource& source) {
    const auto layout = std::make_tuple(material, source.normal.has_value(), source.uv.has_value(),
                                        source.has_color());
    const auto found = part_of_layout_.find(layout);
    if (scene_.parts.size() >= kScenePartsMax && found != part_of_layout_.end()) {
      scene_.parts_merged = true;
      return scene_.parts[found->second];
    }
    const Node& node = document_.nodes[node_index];
    const Mesh& mesh = document_.meshes[node.mesh];
    const auto mesh_name = [&] {
      return mesh.name.empty() ? at_index("meshes", node.mesh) : mesh.name;
    };
    const auto node_name = [&] {
      return node.name.empty() ? at_index("nodes", node_index) : node.name;
    };
    MeshPart part;
    part.name = (node.name.empty() ? mesh.name : node.name).substr(0, kPartNameBytesMax);
    part.material = material;
    part.mesh = meshes_.index_of(node.mesh, mesh_name);
    part.node = nodes_.index_of(node_index, node_name);
    part.group = groups_.index_of({node.mesh, index}, [&] {
      return mesh_name().substr(0, kPartNameBytesMax) + "/" + std::to_string(index);
    });
    part_of_layout_[layout] = scene_.parts.size();
    return scene_.parts.emplace_back(std::move(part));
  }

  const Document& document_;
  Accessors& accessors_;
  Textures& textures_;
  Scene& scene_;
  RigBuilder& rig_;
  Vertices vertices_;
  NameList<int> meshes_, nodes_;
  NameList<std::pair<int, size_t>> groups_;  // mesh, primitive
  int64_t flat_primitive_count_ = 0, bare_primitive_count_ = 0;
  int64_t incomplete_count_ = 0;  // primitives of nodes
  std::string first_incomplete_;
  int64_t triangle_count_ = 0, vertex_count_ = 0;
  // (material, attributes present) -> the last such part.
  std::map<std::tuple<int, bool, bool, bool>, size_t> part_of_layout_;
};

}  // namespace

Status add_meshes(const Document& document, Accessors& accessors, Textures& textures, Scene& scene,
                  RigBuilder& rig) {
  MeshLoader loader(document, accessors, textures, scene, rig);
  for (const int node : document.order) {
    if (document.nodes[node].is_shown) VOXELD_TRY(loader.add_node(node));
  }
  return loader.finish();
}

}  // namespace voxeld::gltf
