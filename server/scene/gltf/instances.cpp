#include "server/scene/gltf/instances.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <string>

#include "server/base/cancel_point.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::gltf {
namespace {

struct Columns {
  std::optional<Elements> translation, rotation, scale, color;
};

Transform transform_of(const Columns& columns, uint64_t i) {
  Transform transform;
  if (columns.translation) transform.translation = glm::dvec3(columns.translation->vector(i));
  if (columns.scale) transform.scale = glm::dvec3(columns.scale->vector(i));
  if (columns.rotation) {
    const glm::dvec4 xyzw = columns.rotation->vector(i, Scaling::kAlways);
    const glm::dquat q(xyzw.w, xyzw.x, xyzw.y, xyzw.z);
    const double length = glm::length(q);
    if (length > 0.0 && std::isfinite(length)) transform.rotation = q / length;
  }
  return transform;
}

glm::vec4 color_of(const Elements& column, uint64_t i) {
  glm::vec4 color(column.vector(i, Scaling::kAlways));
  if (column.component_count == 3) color.a = 1.0f;
  return {unit_clamped(color.r), unit_clamped(color.g), unit_clamped(color.b),
          unit_clamped(color.a)};
}

}  // namespace

Result<Instances> read_instances(const Document& document, Accessors& accessors, int index) {
  const Attributes& attributes = *document.nodes[index].instances;
  const std::string path =
      at_index("nodes", index) + ".extensions.EXT_mesh_gpu_instancing.attributes";
  std::optional<uint64_t> count;
  Columns columns;
  const auto open = [&](std::optional<Elements>& column, const Expected& expected) -> Status {
    const auto found = attributes.find(std::string(expected.use));
    if (found == attributes.end()) return {};
    VOXELD_ASSIGN(column, accessors.open(found->second, expected));
    if (column->count > kInstancesMax) {
      return over_limit(document.name, path, "copies of a mesh", kInstancesMax,
                        static_cast<int64_t>(column->count));
    }
    if (count.value_or(column->count) != column->count) {
      return document.malformed(path + "." + std::string(expected.use), "elements of the attribute",
                                std::to_string(*count) + " as others",
                                std::to_string(column->count));
    }
    count = column->count;
    return {};
  };
  VOXELD_TRY(open(columns.translation, {"TRANSLATION", 3, 3, Expected::kFloat}));
  VOXELD_TRY(open(columns.rotation, {"ROTATION", 4, 4, Expected::kFloatOrSmall}));
  VOXELD_TRY(open(columns.scale, {"SCALE", 3, 3, Expected::kFloat}));
  VOXELD_TRY(open(columns.color, {"_COLOR_0", 3, 4, Expected::kFloatOrSmall}));
  if (!count) {
    return document.malformed(path, "no attribute of copies", "TRANSLATION, ROTATION or SCALE",
                              "none");
  }
  Instances instances;
  for (uint64_t i = 0; i < *count; ++i) {
    cancel_point();
    instances.node_from_instance.push_back(transform_of(columns, i).matrix());
    if (columns.color) instances.colors.push_back(color_of(*columns.color, i));
  }
  return instances;
}

}  // namespace voxeld::gltf
