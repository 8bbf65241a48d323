// Converts triangles of glTF primitives into mesh parts in world space.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/nodes.h"
#include "server/scene/gltf/textures.h"
#include "server/scene/gltf/vertex.h"
#include "server/scene/name_list.h"
#include "server/scene/scene.h"

namespace voxeld {

// Adds the meshes of nodes to a scene, and their bindings to a rig if there is one. Unused vertices
// are omitted, because files share one vertex array among many primitives.
class GltfMeshes {
 public:
  GltfMeshes(std::string_view name, const GltfDocument& document, const GltfNodes& nodes,
             GltfAccessors& accessors, GltfTextures& textures, Scene& scene,
             GltfRigBuilder* rig = nullptr)
      : name_(name),
        document_(document),
        accessors_(accessors),
        textures_(textures),
        vertices_(name, document, nodes, accessors, rig),
        scene_(scene),
        rig_(rig),
        meshes_(scene.meshes),
        nodes_(scene.nodes),
        groups_(scene.groups) {}

  // Adds the node's mesh, if it has one. Errors: malformed-mesh.
  Status add_node(int node);
  // Primitives of points and lines, which have no surface, are skipped.
  int64_t skipped_primitive_count() const { return skipped_primitive_count_; }

 private:
  bool is_compressed(const GltfPrimitive& primitive) const;
  // `index`: the primitive's place in the node's mesh.
  Status add_primitive(int node, size_t index);
  // Vertex numbers of the file, 3 per triangle.
  Result<std::vector<uint32_t>> triangles_of(const GltfPrimitive& primitive,
                                             const std::string& path, uint64_t vertex_count);
  Result<uint64_t> count_triangles(int mode, uint64_t corner_count, const std::string& path);
  MeshPart& part_for(int node, size_t index, int material, const GltfVertexSource& source);
  void set_origin(int node, size_t index, MeshPart& part);

  std::string_view name_;
  const GltfDocument& document_;
  GltfAccessors& accessors_;
  GltfTextures& textures_;
  GltfVertices vertices_;
  Scene& scene_;
  GltfRigBuilder* rig_;
  NameList<int> meshes_, nodes_;
  NameList<std::pair<int, size_t>> groups_;  // mesh, primitive
  int64_t skipped_primitive_count_ = 0;
  int64_t triangle_count_ = 0, vertex_count_ = 0;
  // (material, attributes present) -> the last such part.
  std::map<std::tuple<int, bool, bool, bool>, size_t> part_of_layout_;
};

}  // namespace voxeld
