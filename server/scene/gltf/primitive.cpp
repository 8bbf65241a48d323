#include "server/scene/gltf/primitive.h"

#include <algorithm>
#include <utility>

#include "proto/limits.h"
#include "proto/range_text.h"
#include "server/base/cancel_point.h"
#include "server/scene/gltf/extensions.h"
#include "server/scene/mesh_error.h"
#include "server/scene/normals.h"
#include "server/scene/vertex_table.h"

namespace voxeld {
namespace {

enum Mode { kTriangles = 4, kStrip = 5, kFan = 6 };

// Renumbers the vertices of a file in the order of their first use. It uses a plain array if most
// are used, and a hash table if a primitive uses few of many.
class Renumbering {
 public:
  Renumbering(uint64_t vertex_count, size_t corner_count)
      : is_dense_(vertex_count <= 8 * static_cast<uint64_t>(corner_count) + 1024) {
    if (is_dense_) dense_.assign(vertex_count, kNone);
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

}  // namespace

Status GltfMeshes::add_node(int node) {
  const int mesh = document_.nodes[static_cast<size_t>(node)].mesh;
  if (mesh < 0) return {};
  const GltfMesh& from = document_.meshes[static_cast<size_t>(mesh)];
  for (size_t i = 0; i < from.primitives.size(); ++i) {
    const int mode = from.primitives[i].mode;
    if (mode < kTriangles) {
      ++skipped_primitive_count_;
      continue;
    }
    VOXELD_TRY(add_primitive(node, i));
  }
  return {};
}

// An unnamed mesh or node is named by its place in the file, as in errors.
void GltfMeshes::set_origin(int node_index, size_t index, MeshPart& part) {
  const GltfNode& node = document_.nodes[static_cast<size_t>(node_index)];
  const auto mesh_name = [&] {
    const std::string& own = document_.meshes[static_cast<size_t>(node.mesh)].name;
    return own.empty() ? "meshes[" + std::to_string(node.mesh) + "]" : own;
  };
  part.mesh = meshes_.index_of(node.mesh, mesh_name);
  part.node = nodes_.index_of(node_index, [&] {
    return node.name.empty() ? "nodes[" + std::to_string(node_index) + "]" : node.name;
  });
  part.group = groups_.index_of({node.mesh, index},
                                [&] { return mesh_name() + "/" + std::to_string(index); });
}

// Returns a new part, or, in a full scene, the last one with the same material and attributes.
MeshPart& GltfMeshes::part_for(int node_index, size_t index, int material,
                               const GltfVertexSource& source) {
  const auto layout = std::make_tuple(material, source.normal.has_value(), source.uv.has_value(),
                                      source.color.has_value());
  const auto found = part_of_layout_.find(layout);
  if (scene_.parts.size() >= kScenePartsMax && found != part_of_layout_.end()) {
    scene_.parts_merged = true;
    return scene_.parts[found->second];
  }
  const GltfNode& node = document_.nodes[static_cast<size_t>(node_index)];
  MeshPart part;
  part.name = node.name.empty() ? document_.meshes[static_cast<size_t>(node.mesh)].name : node.name;
  part.material = material;
  set_origin(node_index, index, part);
  part_of_layout_[layout] = scene_.parts.size();
  return scene_.parts.emplace_back(std::move(part));
}

Status GltfMeshes::add_primitive(int node, size_t index) {
  const int mesh = document_.nodes[static_cast<size_t>(node)].mesh;
  const GltfPrimitive& primitive = document_.meshes[static_cast<size_t>(mesh)].primitives[index];
  const std::string path =
      "meshes[" + std::to_string(mesh) + "].primitives[" + std::to_string(index) + "]";
  if (is_compressed(primitive)) {
    return unread_extension(name_, path, "the data is compressed", primitive.compressed_by);
  }
  VOXELD_ASSIGN(const GltfVertexSource source, vertices_.open(node, primitive, path));
  VOXELD_ASSIGN(std::vector<uint32_t> corners,
                triangles_of(primitive, path, source.position.count()));
  if (corners.empty()) return {};
  VOXELD_ASSIGN(const bool is_mirrored, vertices_.is_mirrored(source, corners[0]));
  const int material = textures_.use_material(primitive.material);
  MeshPart& part = part_for(node, index, material, source);
  if (material >= 0 && scene_.materials[static_cast<size_t>(material)].image >= 0 && !source.uv) {
    add_warning(scene_, "no-texture-coordinates",
                std::string(name_) + " " + path + ": has no coordinates for its texture");
  }
  SkinPart* skin =
      rig_ == nullptr ? nullptr : &rig_->part(static_cast<size_t>(&part - scene_.parts.data()));
  const size_t first_corner = part.indices.size();
  Renumbering renumbering(source.position.count(), corners.size());
  part.indices.reserve(first_corner + corners.size());
  for (const uint32_t corner : corners) {
    cancel_point();
    const auto next = static_cast<uint32_t>(part.positions.size());
    const auto [number, is_new] = renumbering.number_of(corner, next);
    part.indices.push_back(number);
    if (!is_new) continue;
    if (++vertex_count_ > limits::kVerticesMax) {
      return over_limit(name_, path, "vertices of the scene", limits::kVerticesMax, vertex_count_);
    }
    VOXELD_TRY(vertices_.append(source, corner, part, skin));
  }
  for (size_t i = first_corner; i + 2 < part.indices.size() && is_mirrored; i += 3) {
    std::swap(part.indices[i + 1], part.indices[i + 2]);
  }
  repair_normals(part.positions, std::span(part.indices).subspan(first_corner), part.normals);
  return {};
}

// Whether some accessor gets its bytes only from an extension that is not read; it would be all
// zeros.
bool GltfMeshes::is_compressed(const GltfPrimitive& primitive) const {
  if (primitive.compressed_by.empty()) return false;
  const auto is_empty = [&](int accessor) {
    const GltfAccessor& a = document_.accessors[static_cast<size_t>(accessor)];
    return a.view < 0 && !a.sparse;
  };
  return (primitive.indices >= 0 && is_empty(primitive.indices)) ||
         std::any_of(primitive.attributes.begin(), primitive.attributes.end(),
                     [&](const auto& attribute) { return is_empty(attribute.second); });
}

Result<uint64_t> GltfMeshes::count_triangles(int mode, uint64_t corner_count,
                                             const std::string& path) {
  if (mode > kFan) {
    return malformed_mesh(name_, path + ".mode", "unknown mode", "0 to 6", std::to_string(mode));
  }
  if (mode == kTriangles && corner_count % 3 != 0) {
    return malformed_mesh(name_, path, "corners of triangles", "a multiple of 3",
                          std::to_string(corner_count));
  }
  const uint64_t count =
      mode == kTriangles ? corner_count / 3 : (corner_count < 3 ? 0 : corner_count - 2);
  triangle_count_ += static_cast<int64_t>(count);
  if (triangle_count_ > limits::kTrianglesMax) {
    return over_limit(name_, path, "triangles of the scene", limits::kTrianglesMax,
                      triangle_count_);
  }
  return count;
}

Result<std::vector<uint32_t>> GltfMeshes::triangles_of(const GltfPrimitive& primitive,
                                                       const std::string& path,
                                                       uint64_t vertex_count) {
  std::optional<GltfReader> indices;
  if (primitive.indices >= 0) {
    VOXELD_ASSIGN(indices,
                  accessors_.open(primitive.indices, {"indices", 1, 1, GltfExpected::kUnsigned}));
  }
  const uint64_t corner_count = indices ? indices->count() : vertex_count;
  VOXELD_ASSIGN(const uint64_t count, count_triangles(primitive.mode, corner_count, path));
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
    if (corner < vertex_count) continue;
    return malformed_mesh(name_, path + ".indices", "index out of range",
                          index_text(vertex_count, "vertices"), std::to_string(corner));
  }
  return corners;
}

}  // namespace voxeld
