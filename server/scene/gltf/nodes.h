// The node tree of a glTF document: the nodes that the scene shows, and their places.
#pragma once

#include <vector>

#include <glm/mat4x4.hpp>

#include "proto/result.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

struct NodeTree {
  // Of every node, because joints may be outside the scene.
  std::vector<glm::dmat4> world_from_node;
  std::vector<int> parents;  // of every node; -1 for roots
  std::vector<int> order;    // every node, parents before children
  std::vector<int> shown;    // nodes of the scene, parents before children
};

// Walks the tree. Errors: malformed-mesh for a node with two parents, a cycle, or a tree deeper
// than limits::kGltfNodeDepthMax.
Result<NodeTree> walk_nodes(const Document& document);

}  // namespace voxeld::gltf
