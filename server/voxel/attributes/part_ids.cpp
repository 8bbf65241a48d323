#include "server/voxel/attributes/part_ids.h"

#include <cstdint>
#include <string_view>

namespace voxeld {
namespace {

std::string_view plural_of(LabelKind kind) {
  switch (kind) {
    case LabelKind::kMesh:
      return "meshes";
    case LabelKind::kNode:
      return "nodes";
    case LabelKind::kMaterial:
      return "materials";
    case LabelKind::kGroup:
      break;
  }
  return "groups";
}

// The option of the request that has too many ids, for the error message.
std::string_view asked_by(Channel channel) {
  if (channel == Channel::kColor) return "color: dominant: ";
  return channel == Channel::kLabel ? "labels: " : "channels: material: ";
}

// The index of the part's mesh, node, material or group; -1: none.
int64_t index_of(const MeshPart& part, LabelKind kind) {
  switch (kind) {
    case LabelKind::kMesh:
      return part.mesh;
    case LabelKind::kNode:
      return part.node;
    case LabelKind::kMaterial:
      return part.material;
    case LabelKind::kGroup:
      break;
  }
  return part.group;
}

size_t count_of(const Scene& scene, LabelKind kind) {
  switch (kind) {
    case LabelKind::kMesh:
      return scene.meshes.size();
    case LabelKind::kNode:
      return scene.nodes.size();
    case LabelKind::kMaterial:
      return scene.materials.size();
    case LabelKind::kGroup:
      break;
  }
  return scene.groups.size();
}

}  // namespace

std::vector<std::string> id_names(const Scene& scene, LabelKind kind) {
  if (kind == LabelKind::kMesh) return scene.meshes;
  if (kind == LabelKind::kNode) return scene.nodes;
  if (kind == LabelKind::kGroup) return scene.groups;
  std::vector<std::string> names;
  for (const Material& material : scene.materials) names.push_back(material.name);
  return names;
}

Result<IdChannel> id_channel(const Scene& scene, Channel channel, LabelKind labels) {
  const LabelKind kind = channel == Channel::kLabel ? labels : LabelKind::kMaterial;
  const size_t count = count_of(scene, kind);
  // Materials are never merged.
  const bool is_merged = scene.parts_merged && kind != LabelKind::kMaterial;
  if (count > UINT16_MAX || is_merged) {
    return Error{ErrorCode::kInvalidOption,
                 std::string(asked_by(channel)) + "too many " + std::string(plural_of(kind)),
                 "at most " + std::to_string(UINT16_MAX),
                 is_merged
                     ? "more than " + std::to_string(scene.parts.size() - 1) + " parts of the file"
                     : std::to_string(count)};
  }
  IdChannel ids{channel, {}, count > kIdsOnDeviceMax};
  for (const MeshPart& part : scene.parts) {
    ids.part_ids.push_back(static_cast<uint16_t>(index_of(part, kind) + 1));
  }
  return ids;
}

}  // namespace voxeld
