#include "server/worker/mesh/inspect.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "proto/options/words.h"
#include "server/scene/describe_asset.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Items listed. Thousands of parts would make a description that nobody reads and that no task
// message (1 MiB) holds. The counts cover all.
constexpr size_t kListedMax = 200;
constexpr size_t kNameBytesMax = 200;
// Bytes of the reason why an animation is unusable; it names files and joints.
constexpr size_t kReasonBytesMax = 500;
// Bytes to which names of ids are cut at most; ids are never omitted.
constexpr size_t kIdNameBytesMin = 32;
constexpr size_t kIdListBytesMax = size_t{2} << 20;

// A name as UTF-8: other bytes, and those of a character that was cut off, become U+FFFD.
json utf8_name(const std::string& name) {
  return json::parse(json(name).dump(-1, ' ', false, json::error_handler_t::replace));
}

std::string short_name(const std::string& name) {
  return name.substr(0, kNameBytesMax);
}

// The number of distinct positions of each listed part; null if the mesh is too large to count.
std::vector<json> vertices_of_parts(const Scene& scene,
                                    const std::optional<MeshTopology>& topology) {
  std::vector<json> counts(std::min(scene.parts.size(), kListedMax));
  for (size_t i = 0; i < counts.size() && topology; ++i) {
    counts[i] =
        scene.parts.size() == 1 ? topology->distinct_positions : distinct_positions(scene.parts[i]);
  }
  return counts;
}

json describe_parts(const Scene& scene, const std::vector<json>& vertices) {
  json list = json::array();
  for (size_t i = 0; i < std::min(scene.parts.size(), kListedMax); ++i) {
    const MeshPart& part = scene.parts[i];
    json item = {{"name", short_name(part.name)},
                 {"triangles", part.indices.size() / 3},
                 {"vertices", vertices[i]},
                 {"material", nullptr},
                 {"mesh", short_name(scene.meshes[part.mesh])},
                 {"node", short_name(scene.nodes[part.node])},
                 {"group", short_name(scene.groups[part.group])}};
    if (part.material >= 0) item["material"] = part.material;
    list.push_back(std::move(item));
  }
  return list;
}

json describe_materials(const Scene& scene) {
  json list = json::array();
  for (size_t i = 0; i < std::min(scene.materials.size(), kListedMax); ++i) {
    const Material& material = scene.materials[i];
    json item = {{"name", short_name(material.name)},
                 {"base_color",
                  {material.base_color.r, material.base_color.g, material.base_color.b,
                   material.base_color.a}},
                 {"texture", nullptr},
                 {"found", false}};
    if (material.image >= 0 && static_cast<size_t>(material.image) < scene.images.size()) {
      item["texture"] = short_name(scene.images[static_cast<size_t>(material.image)].name);
      item["found"] = true;
    }
    list.push_back(std::move(item));
  }
  return list;
}

json describe_joints(const std::vector<SceneJoint>& joints) {
  json list = json::array();
  for (size_t i = 0; i < std::min(joints.size(), kListedMax); ++i) {
    const SceneJoint& joint = joints[i];
    list.push_back({{"name", short_name(joint.name)},
                    {"parent", joint.parent < 0 ? json() : json(joint.parent)}});
  }
  return list;
}

std::string reason_of(const AnimationInfo& animation) {
  return animation.unusable->message().substr(0, kReasonBytesMax);
}

json describe_animations(const std::vector<AnimationInfo>& animations) {
  json list = json::array();
  for (size_t i = 0; i < std::min(animations.size(), kListedMax); ++i) {
    const AnimationInfo& animation = animations[i];
    const bool is_even = animation.frame_count > 0;
    list.push_back({{"name", short_name(animation.name)},
                    {"frames", is_even ? json(animation.frame_count) : json()},
                    {"frame_rate", is_even ? json(animation.frame_rate) : json()},
                    {"duration_s", animation.duration_s},
                    {"unusable", animation.unusable ? json(reason_of(animation)) : json()}});
  }
  return list;
}

json describe_meshes(const std::vector<AssetDescription::Mesh>& meshes,
                     const std::vector<json>& vertices) {
  json list = json::array();
  for (size_t i = 0; i < std::min(meshes.size(), kListedMax); ++i) {
    const AssetDescription::Mesh& mesh = meshes[i];
    list.push_back({{"name", short_name(mesh.name)},
                    {"material", mesh.material < 0 ? json() : json(mesh.material)},
                    {"vertices", vertices[i]},
                    {"triangles", mesh.triangle_count},
                    {"influences_max", mesh.influences_max},
                    {"morph_targets", mesh.has_morph_targets}});
  }
  return list;
}

json describe_missing(const Scene& scene) {
  json list = json::array();
  for (size_t i = 0; i < std::min(scene.missing_files.size(), kListedMax); ++i) {
    const MissingFile& missing = scene.missing_files[i];
    list.push_back(
        {{"name", short_name(missing.name)}, {"needed_by", short_name(missing.needed_by)}});
  }
  return list;
}

// Null if the mesh was too large to examine.
template <typename T>
json known(const std::optional<MeshTopology>& topology, T MeshTopology::*count) {
  return topology ? json((*topology).*count) : json();
}

json describe_topology(const std::optional<MeshTopology>& topology) {
  const auto optional = [&](std::optional<int64_t> MeshTopology::*count) {
    return topology && (*topology).*count ? json(*((*topology).*count)) : json();
  };
  return {{"watertight", topology ? json(topology->watertight()) : json()},
          {"open_edges", known(topology, &MeshTopology::open_edges)},
          {"non_manifold_edges", known(topology, &MeshTopology::non_manifold_edges)},
          {"flipped_edges", known(topology, &MeshTopology::flipped_edges)},
          {"degenerate_triangles", known(topology, &MeshTopology::degenerate_triangles)},
          {"components", known(topology, &MeshTopology::components)},
          {"enclosed_components", optional(&MeshTopology::enclosed_components)},
          {"inner_walls", optional(&MeshTopology::inner_walls)}};
}

// The axes agree on closed meshes, so nothing is ambiguous.
json ambiguous_fraction(const FillStats& fill, const std::optional<MeshTopology>& topology) {
  if (fill.ambiguous_fraction) return *fill.ambiguous_fraction;
  return topology && topology->closed() ? json(0.0) : json();
}

}  // namespace

json describe_warnings(const std::vector<Warning>& warnings) {
  json list = json::array();
  for (const Warning& warning : warnings) {
    list.push_back(
        {{"code", warning.code}, {"detail", warning.detail.substr(0, kWarningBytesMax)}});
  }
  return list;
}

json describe_ids(const std::vector<std::string>& names) {
  const size_t bytes_max = std::clamp(kIdListBytesMax / std::max<size_t>(names.size(), 1),
                                      kIdNameBytesMin, kNameBytesMax);
  json list = json::array();
  for (const std::string& name : names) {
    list.push_back({{"id", list.size() + 1}, {"name", utf8_name(name.substr(0, bytes_max))}});
  }
  return list;
}

json describe_mesh(const std::optional<MeshTopology>& topology,
                   const std::optional<FillStats>& fill) {
  json description = describe_topology(topology);
  description["closed"] = topology ? json(topology->closed()) : json();
  description["ambiguous_fraction"] = fill ? ambiguous_fraction(*fill, topology) : json();
  return description;
}

json describe_fill(const FillStats& fill, const std::optional<MeshTopology>& topology) {
  json description = describe_topology(topology);
  for (const char* name : {"watertight", "degenerate_triangles"}) description.erase(name);
  description["sign"] = option_words::sign_name(fill.sign);
  description["reason"] = fill.reason;
  description["closed"] = topology ? json(topology->closed()) : json();
  description["ambiguous_fraction"] = ambiguous_fraction(fill, topology);
  return description;
}

json describe_scene(const AnimatedScene& animated) {
  const Scene& scene = animated.scene;
  const Box3d box = scene.bounds();
  const AssetDescription asset = describe_asset(animated);
  const std::optional<MeshTopology> topology = mesh_topology(scene);
  const std::vector<json> vertices = vertices_of_parts(scene, topology);
  json description = {{"format", scene.format},
                      {"triangles", scene.triangle_count()},
                      {"vertices", known(topology, &MeshTopology::distinct_positions)},
                      {"part_count", scene.parts.size()},
                      {"material_count", scene.materials.size()},
                      {"mesh_count", scene.meshes.size()},
                      {"node_count", scene.nodes.size()},
                      {"group_count", scene.groups.size()},
                      {"has_colors", scene.has_colors()},
                      {"bounds", nullptr},
                      {"parts", describe_parts(scene, vertices)},
                      {"materials", describe_materials(scene)},
                      {"missing_files", describe_missing(scene)},
                      {"meshes", describe_meshes(asset.meshes, vertices)},
                      {"joints", describe_joints(asset.joints)},
                      {"joint_count", asset.joints.size()},
                      {"animations", describe_animations(asset.animations)},
                      {"animation_count", asset.animations.size()}};
  if (!box.empty()) {
    description["bounds"] = {{"min", {box.min.x, box.min.y, box.min.z}},
                             {"max", {box.max.x, box.max.y, box.max.z}}};
  }
  description.update(describe_topology(topology));
  return description;
}

}  // namespace voxeld
