#include "server/scene/gltf/nodes.h"

#include <string>

#include "proto/limits.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

std::string path_of(int node) {
  return "nodes[" + std::to_string(node) + "]";
}

// The parent of each node; -1 for roots.
Result<std::vector<int>> parents_of(std::string_view name, const GltfDocument& document) {
  std::vector<int> parents(document.nodes.size(), -1);
  for (size_t i = 0; i < document.nodes.size(); ++i) {
    for (const int child : document.nodes[i].children) {
      int& parent = parents[static_cast<size_t>(child)];
      if (parent >= 0) {
        return malformed_mesh(name, path_of(child), "the node has two parents", "a tree",
                              path_of(parent) + " and " + path_of(static_cast<int>(i)));
      }
      parent = static_cast<int>(i);
    }
  }
  return parents;
}

struct Visit {
  int node, depth;
};

}  // namespace

Result<GltfNodes> walk_gltf_nodes(std::string_view name, const GltfDocument& document) {
  const size_t count = document.nodes.size();
  GltfNodes out;
  VOXELD_ASSIGN(out.parents, parents_of(name, document));
  const std::vector<int>& parents = out.parents;
  out.world_from_node.assign(count, glm::dmat4(1.0));
  std::vector<bool> is_listed(count, !document.scene_nodes);
  if (document.scene_nodes) {
    for (const int node : *document.scene_nodes) is_listed[static_cast<size_t>(node)] = true;
  }
  // A node is shown if the scene lists it or a node above it.
  std::vector<bool> is_shown(count), is_visited(count);
  std::vector<Visit> stack;
  for (size_t i = count; i-- > 0;) {
    if (parents[i] < 0) stack.push_back({static_cast<int>(i), 1});
  }
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const auto at = static_cast<size_t>(visit.node);
    if (visit.depth > limits::kGltfNodeDepthMax) {
      return over_limit(name, path_of(visit.node), "depth of the node tree",
                        limits::kGltfNodeDepthMax, visit.depth);
    }
    const GltfNode& node = document.nodes[at];
    is_visited[at] = true;
    out.order.push_back(visit.node);
    is_shown[at] = is_listed[at];
    out.world_from_node[at] = node.parent_from_node;
    if (parents[at] >= 0) {
      const auto parent = static_cast<size_t>(parents[at]);
      out.world_from_node[at] = out.world_from_node[parent] * node.parent_from_node;
      if (is_shown[parent]) is_shown[at] = true;
    }
    if (is_shown[at]) out.shown.push_back(visit.node);
    for (size_t c = node.children.size(); c-- > 0;) {
      stack.push_back({node.children[c], visit.depth + 1});
    }
  }
  // Each node has one parent, so nodes that no root reaches are in cycles.
  for (size_t i = 0; i < count; ++i) {
    if (is_visited[i]) continue;
    return malformed_mesh(name, path_of(static_cast<int>(i)), "the node stands in a cycle",
                          "a tree", "");
  }
  return out;
}

}  // namespace voxeld
