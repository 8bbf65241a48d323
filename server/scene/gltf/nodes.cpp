#include "server/scene/gltf/nodes.h"

#include <string>

#include "proto/limits.h"
#include "server/scene/mesh_error.h"

namespace voxeld::gltf {
namespace {

std::string path_of(size_t node) {
  return at_index("nodes", node);
}

// The parent of each node; -1 for roots.
Result<std::vector<int>> parents_of(const Document& document) {
  std::vector<int> parents(document.nodes.size(), -1);
  for (size_t i = 0; i < document.nodes.size(); ++i) {
    for (const int child : document.nodes[i].children) {
      int& parent = parents[static_cast<size_t>(child)];
      if (parent >= 0) {
        return document.malformed(path_of(static_cast<size_t>(child)), "the node has two parents",
                                  "a tree",
                                  path_of(static_cast<size_t>(parent)) + " and " + path_of(i));
      }
      parent = static_cast<int>(i);
    }
  }
  return parents;
}

// The nodes that the scene lists. A document without scenes shows all.
std::vector<bool> listed_nodes(const Document& document) {
  std::vector<bool> is_listed(document.nodes.size(), document.scenes.empty());
  if (document.scenes.empty()) return is_listed;
  for (const int node : document.scenes[static_cast<size_t>(document.scene)].nodes) {
    is_listed[static_cast<size_t>(node)] = true;
  }
  return is_listed;
}

}  // namespace

Result<NodeTree> walk_nodes(const Document& document) {
  struct Visit {
    size_t node;
    int depth;
  };
  const size_t count = document.nodes.size();
  NodeTree tree;
  VOXELD_ASSIGN(tree.parents, parents_of(document));
  tree.world_from_node.assign(count, glm::dmat4(1.0));
  // A node is shown if the scene lists it or a node above it.
  std::vector<bool> is_shown = listed_nodes(document), is_visited(count);
  std::vector<Visit> stack;
  for (size_t i = count; i-- > 0;) {
    if (tree.parents[i] < 0) stack.push_back({i, 1});
  }
  while (!stack.empty()) {
    const auto [at, depth] = stack.back();
    stack.pop_back();
    if (depth > limits::kGltfNodeDepthMax) {
      return over_limit(document.name, path_of(at), "depth of the node tree",
                        limits::kGltfNodeDepthMax, depth);
    }
    const Node& node = document.nodes[at];
    is_visited[at] = true;
    tree.order.push_back(static_cast<int>(at));
    tree.world_from_node[at] = node.parent_from_node;
    if (tree.parents[at] >= 0) {
      const auto parent = static_cast<size_t>(tree.parents[at]);
      tree.world_from_node[at] = tree.world_from_node[parent] * node.parent_from_node;
      if (is_shown[parent]) is_shown[at] = true;
    }
    if (is_shown[at]) tree.shown.push_back(static_cast<int>(at));
    for (size_t c = node.children.size(); c-- > 0;) {
      stack.push_back({static_cast<size_t>(node.children[c]), depth + 1});
    }
  }
  // Each node has one parent, so nodes that no root reaches are in cycles.
  for (size_t i = 0; i < count; ++i) {
    if (is_visited[i]) continue;
    return document.malformed(path_of(i), "the node stands in a cycle", "a tree");
  }
  return tree;
}

}  // namespace voxeld::gltf
