#include "server/worker/inspect.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "proto/option_words.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Thousands of parts would make a description that nobody reads, and one that no task message
// (1 MiB) holds; the counts are of all.
constexpr size_t kListedMax = 200;
constexpr size_t kNameBytesMax = 200;

std::string short_name(const std::string& name) {
  return name.substr(0, kNameBytesMax);
}

json describe_parts(const Scene& scene) {
  json list = json::array();
  for (size_t i = 0; i < std::min(scene.parts.size(), kListedMax); ++i) {
    const MeshPart& part = scene.parts[i];
    json item = {{"name", short_name(part.name)},
                 {"triangles", part.indices.size() / 3},
                 {"vertices", part.positions.size()},
                 {"material", nullptr}};
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
                 {"texture", nullptr}};
    if (material.image >= 0 && static_cast<size_t>(material.image) < scene.images.size()) {
      item["texture"] = short_name(scene.images[static_cast<size_t>(material.image)].name);
    }
    list.push_back(std::move(item));
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

void add_enclosed(const MeshTopology& topology, json& description) {
  if (topology.enclosed_components) {
    description["enclosed_components"] = *topology.enclosed_components;
  }
  if (topology.inner_walls) description["inner_walls"] = *topology.inner_walls;
}

void add_topology(const Scene& scene, json& description) {
  for (const char* name :
       {"watertight", "open_edges", "non_manifold_edges", "flipped_edges", "degenerate_triangles",
        "components", "enclosed_components", "inner_walls"}) {
    description[name] = nullptr;
  }
  const auto topology = mesh_topology(scene);
  if (!topology) return;
  description["watertight"] = topology->watertight();
  description["open_edges"] = topology->open_edges;
  description["non_manifold_edges"] = topology->non_manifold_edges;
  description["flipped_edges"] = topology->flipped_edges;
  description["degenerate_triangles"] = topology->degenerate_triangles;
  description["components"] = topology->components;
  add_enclosed(*topology, description);
}

}  // namespace

json describe_fill(const FillStats& fill, const std::optional<MeshTopology>& topology) {
  json description = {{"sign", option_words::sign_name(fill.sign)},
                      {"reason", fill.reason},
                      {"closed", nullptr},
                      {"open_edges", nullptr},
                      {"non_manifold_edges", nullptr},
                      {"flipped_edges", nullptr},
                      {"components", nullptr},
                      {"enclosed_components", nullptr},
                      {"inner_walls", nullptr},
                      {"ambiguous_fraction", nullptr}};
  if (fill.ambiguous_fraction) description["ambiguous_fraction"] = *fill.ambiguous_fraction;
  if (!topology) return description;
  description["closed"] = topology->closed();
  description["open_edges"] = topology->open_edges;
  description["non_manifold_edges"] = topology->non_manifold_edges;
  description["flipped_edges"] = topology->flipped_edges;
  description["components"] = topology->components;
  add_enclosed(*topology, description);
  // The axes agree on closed meshes.
  if (topology->closed() && !fill.ambiguous_fraction) description["ambiguous_fraction"] = 0.0;
  return description;
}

json describe_scene(const Scene& scene) {
  const Box3d box = scene.bounds();
  json description = {{"format", scene.format},
                      {"triangles", scene.triangle_count()},
                      {"vertices", scene.vertex_count()},
                      {"part_count", scene.parts.size()},
                      {"material_count", scene.materials.size()},
                      {"has_colors", scene.has_colors()},
                      {"bounds", nullptr},
                      {"parts", describe_parts(scene)},
                      {"materials", describe_materials(scene)},
                      {"missing_files", describe_missing(scene)}};
  if (!box.empty()) {
    description["bounds"] = {{"min", {box.min.x, box.min.y, box.min.z}},
                             {"max", {box.max.x, box.max.y, box.max.z}}};
  }
  add_topology(scene, description);
  return description;
}

}  // namespace voxeld
