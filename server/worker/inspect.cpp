#include "server/worker/inspect.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "server/worker/mesh_topology.h"

namespace voxeld {
namespace {

using nlohmann::json;

// Thousands of parts would make a description that nobody reads; the counts are of all.
constexpr size_t kListedMax = 1000;

json describe_parts(const Scene& scene) {
  json list = json::array();
  for (size_t i = 0; i < std::min(scene.parts.size(), kListedMax); ++i) {
    const MeshPart& part = scene.parts[i];
    json item = {{"name", part.name},
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
    json item = {{"name", material.name},
                 {"base_color",
                  {material.base_color.r, material.base_color.g, material.base_color.b,
                   material.base_color.a}},
                 {"texture", nullptr}};
    if (material.image >= 0 && static_cast<size_t>(material.image) < scene.images.size()) {
      item["texture"] = scene.images[static_cast<size_t>(material.image)].name;
    }
    list.push_back(std::move(item));
  }
  return list;
}

json describe_missing(const Scene& scene) {
  json list = json::array();
  for (const MissingFile& missing : scene.missing_files) {
    list.push_back({{"name", missing.name}, {"needed_by", missing.needed_by}});
  }
  return list;
}

void add_topology(const Scene& scene, json& description) {
  for (const char* name : {"watertight", "open_edges", "non_manifold_edges", "flipped_edges",
                           "degenerate_triangles"}) {
    description[name] = nullptr;
  }
  const auto topology = mesh_topology(scene);
  if (!topology) return;
  description["watertight"] = topology->watertight();
  description["open_edges"] = topology->open_edges;
  description["non_manifold_edges"] = topology->non_manifold_edges;
  description["flipped_edges"] = topology->flipped_edges;
  description["degenerate_triangles"] = topology->degenerate_triangles;
}

}  // namespace

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
