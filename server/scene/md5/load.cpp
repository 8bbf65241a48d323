// Loads md5mesh files as scenes in their bind pose. The files have +z up and clockwise triangles;
// scenes have +y up and counter-clockwise ones.
#include "server/scene/md5/load.h"

#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/images/textures.h"
#include "server/scene/md5/materials.h"

namespace voxeld {
namespace {

// Assigns each part its material of the scene.
class Md5Textures {
 public:
  Md5Textures(Scene& scene, const Bundle& bundle, const std::string& from,
              const LoadOptions& options)
      : scene_(scene), images_(bundle, from), textures_(scene, bundle, "", options) {}

  // If no shader finds an image and the bundle has exactly one, all parts use that one.
  void assume_image(std::string_view name, const std::vector<Md5Part>& parts,
                    const Bundle& bundle) {
    for (const Md5Part& part : parts) {
      if (images_.find(part.shader)) return;
    }
    const std::optional<std::string> image = only_image(bundle);
    if (!image) return;
    assumed_ = textures_.image_index(*image, name);
    if (assumed_ < 0) return;
    add_warning(scene_, "assumed-texture",
                std::string(name) + " names no texture of the upload; " + *image +
                    ", its only image, is used");
  }

  int material_index(const std::string& shader) {
    const auto found = by_shader_.find(shader);
    if (found != by_shader_.end()) return found->second;
    Material material;
    material.name = shader;
    const auto image = images_.find(shader);
    if (assumed_ >= 0) {
      material.image = assumed_;
    } else if (image || !shader.empty()) {
      // A missing image is reported by the shader's name.
      material.image = textures_.image_index(image.value_or(shader), "material " + shown(shader));
    }
    scene_.materials.push_back(std::move(material));
    const int index = static_cast<int>(scene_.materials.size()) - 1;
    by_shader_.emplace(shader, index);
    return index;
  }

 private:
  Scene& scene_;
  Md5Images images_;
  TextureSet textures_;
  int assumed_ = -1;  // an index of an image, for all shaders
  std::map<std::string, int> by_shader_;
};

}  // namespace

std::vector<glm::dvec3> md5_normals(std::span<const glm::dvec3> positions,
                                    std::span<const uint32_t> indices) {
  // Vertices along a texture seam share a position, so normals are summed by position.
  using Key = std::tuple<double, double, double>;
  std::map<Key, glm::dvec3> sums;
  const auto key = [&](uint32_t v) { return Key{positions[v].x, positions[v].y, positions[v].z}; };
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    cancel_point();
    const glm::dvec3 &a = positions[indices[i]], &b = positions[indices[i + 1]],
                     &c = positions[indices[i + 2]];
    const glm::dvec3 area = glm::cross(c - a, b - a);
    for (size_t k = 0; k < 3; ++k) sums[key(indices[i + k])] += area;
  }
  std::vector<glm::dvec3> normals;
  normals.reserve(positions.size());
  for (uint32_t v = 0; v < positions.size(); ++v) {
    cancel_point();
    const auto found = sums.find(key(v));
    const glm::dvec3 sum = found == sums.end() ? glm::dvec3(0.0) : found->second;
    const double length = glm::length(sum);
    normals.push_back(length > 0 ? sum / length : glm::dvec3(0.0, 0.0, 1.0));
  }
  return normals;
}

MeshPart md5_mesh_part(const Md5Part& part, const std::vector<Md5Joint>& joints) {
  const std::vector<glm::dvec3> positions = md5_positions(part, joints);
  const std::vector<glm::dvec3> normals = md5_normals(positions, part.indices);
  MeshPart out;
  out.name = part.name.empty() ? part.shader : part.name;
  out.positions.reserve(positions.size());
  out.normals.reserve(positions.size());
  out.uvs.reserve(positions.size());
  for (size_t v = 0; v < positions.size(); ++v) {
    cancel_point();
    out.positions.push_back(y_up_from_z_up(positions[v]));
    out.normals.push_back(glm::vec3(y_up_from_z_up(normals[v])));
    out.uvs.push_back(part.vertices[v].uv);
  }
  out.indices.reserve(part.indices.size());
  for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
    cancel_point();
    out.indices.insert(out.indices.end(),
                       {part.indices[i], part.indices[i + 2], part.indices[i + 1]});
  }
  return out;
}

Result<Scene> load_md5(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options) {
  std::string storage;
  VOXELD_ASSIGN(Md5Mesh mesh, parse_md5_mesh(name, plain_text(bytes, storage)));
  return md5_scene(name, mesh, bundle, options);
}

Result<Scene> md5_scene(std::string_view name, Md5Mesh& mesh, const Bundle& bundle,
                        const LoadOptions& options) {
  Scene scene;
  scene.format = "md5mesh";
  scene.warnings = std::move(mesh.warnings);
  Md5Textures textures(scene, bundle, std::string(name), options);
  textures.assume_image(name, mesh.parts, bundle);
  size_t triangles = 0;
  scene.meshes.clear();
  for (const Md5Part& part : mesh.parts) {
    scene.parts.push_back(md5_mesh_part(part, mesh.joints));
    scene.parts.back().material = textures.material_index(part.shader);
    // Each mesh of the file is also a node.
    scene.parts.back().mesh = scene.parts.back().node = static_cast<uint32_t>(scene.meshes.size());
    scene.meshes.push_back(scene.parts.back().name);
    triangles += part.indices.size() / 3;
    for (const glm::dvec3& position : scene.parts.back().positions) {
      cancel_point();
      if (is_coordinate(position.x) && is_coordinate(position.y) && is_coordinate(position.z)) {
        continue;
      }
      return malformed_mesh(name, "mesh " + std::to_string(scene.parts.size() - 1),
                            "a vertex that is too far away", "coordinates up to 1e30 in magnitude",
                            "");
    }
  }
  if (triangles == 0) return empty_mesh(name, "no triangles");
  scene.nodes = scene.meshes;
  return scene;
}

}  // namespace voxeld
