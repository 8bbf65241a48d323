// The root of a scene graph is node 0. Transforms alternate with groups and shapes, but any order
// is read. A transform applies to its child: points of the parent = R * points of the child + t.
// So a rotation of a group also turns the translations of its members.
//
// The origin of a model is the corner of cells at floor(size / 2) in each axis, for odd sizes, too.
// The editor turns models about that corner: a cell [v, v + 1) that a negative sign mirrors becomes
// [-v - 1, -v). The editor's own files hold translations that make up for it, so that an odd model
// keeps its middle cell where it was.
#include "server/volumes/vox_scene.h"

#include <cstring>
#include <string>

#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/volumes/volume_error.h"

namespace voxeld::volumes {
namespace {

// parent_from_inner * inner_from_child.
VoxTransform combined_vox(const VoxTransform& outer, const VoxTransform& inner) {
  VoxTransform both;
  for (size_t c = 0; c < 3; ++c) {
    const size_t from = outer.axis[c];
    both.axis[c] = inner.axis[from];
    both.sign[c] = static_cast<int8_t>(outer.sign[c] * inner.sign[from]);
    both.offset[c] = outer.offset[c] + outer.sign[c] * inner.offset[from];
  }
  return both;
}

VoxInstance vox_instance(const VoxModel& model, size_t number, const VoxTransform& transform) {
  VoxInstance instance{number, transform.axis, transform.sign, {}, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    const int64_t side = model.size[transform.axis[c]], middle = side / 2;
    if (transform.sign[c] > 0) {
      instance.first[c] = transform.offset[c] - middle;
      instance.min[c] = instance.first[c];
    } else {
      instance.first[c] = transform.offset[c] + middle - 1;
      instance.min[c] = instance.first[c] - (side - 1);
    }
    instance.max[c] = instance.min[c] + side;
  }
  return instance;
}

class VoxGraph {
 public:
  VoxGraph(std::string_view name, const VoxFile& file) : name_(name), file_(file) {}

  Result<VoxScene> place() {
    scene_.has_graph = !file_.nodes.empty();
    if (scene_.has_graph) {
      VOXELD_TRY(visit("the root", 0, {}, 1));
    } else {
      scene_.instances.push_back(vox_instance(file_.models.front(), 0, {}));
    }
    return std::move(scene_);
  }

 private:
  Status visit(const std::string& parent, int32_t id, const VoxTransform& outer, int depth) {
    cancel_point();
    const VoxNode* node = file_.find_node(id);
    if (node == nullptr) {
      return malformed_volume(name_, parent, "a node that the file lacks", "the id of a node",
                              std::to_string(id));
    }
    if (depth > kVoxDepthMax) {
      return malformed_volume(name_, parent, "nodes are nested too deeply",
                              "at most " + std::to_string(kVoxDepthMax), "more");
    }
    if (++visits_ > kVoxVisitsMax) {
      return malformed_volume(name_, parent, "too many nodes, those named again included",
                              "at most " + std::to_string(kVoxVisitsMax), "more");
    }
    if (node->is_hidden || file_.is_hidden_layer(node->layer)) {
      ++scene_.hidden_count;
      return {};
    }
    if (node->kind == VoxNodeKind::kShape) return add(*node, outer);
    return visit_children(*node, outer, depth);
  }

  Status visit_children(const VoxNode& node, const VoxTransform& outer, int depth) {
    const std::string where = "node " + std::to_string(node.id);
    const bool moves = node.kind == VoxNodeKind::kTransform;
    const VoxTransform inner = moves ? combined_vox(outer, node.transform) : outer;
    for (size_t at = 0; at < node.children.size(); at += sizeof(int32_t)) {
      int32_t child = 0;
      std::memcpy(&child, &node.children[at], sizeof child);
      VOXELD_TRY(visit(where, child, inner, depth + 1));
    }
    return {};
  }

  Status add(const VoxNode& shape, const VoxTransform& transform) {
    const auto model = static_cast<size_t>(shape.model);
    if (shape.model < 0 || model >= file_.models.size()) {
      return malformed_volume(
          name_, "node " + std::to_string(shape.id), "a model that the file lacks",
          index_text(file_.models.size(), "models"), std::to_string(shape.model));
    }
    scene_.instances.push_back(vox_instance(file_.models[model], model, transform));
    return {};
  }

  std::string_view name_;
  const VoxFile& file_;
  VoxScene scene_;
  uint64_t visits_ = 0;
};

}  // namespace

Result<VoxScene> place_vox_models(std::string_view name, const VoxFile& file) {
  return VoxGraph(name, file).place();
}

}  // namespace voxeld::volumes
