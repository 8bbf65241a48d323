// Converts PLY to a Scene: one part, or one per texture, and one for faces without, if faces name
// them ("texnumber").
#include "server/scene/ply/ply.h"

#include <map>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/normals.h"
#include "server/scene/core/polygon_sink.h"
#include "server/scene/images/textures.h"
#include "server/scene/ply/body.h"
#include "server/scene/ply/header.h"

namespace voxeld {
namespace {

// Moves the origin from the bottom left, as MeshLab writes it, to the top left.
glm::vec2 texel_uv(const glm::vec2& uv) {
  return {uv.x, 1.0f - uv.y};
}

// The attributes that faces give to their triangles.
struct TriangleData {
  std::vector<glm::vec4> colors;      // per triangle
  std::vector<glm::vec2> corner_uvs;  // per triangle corner
  std::vector<int> textures;          // per triangle; -1: none
  bool any_without_texture = false;
};

Result<MeshPart> shared_part(std::string_view name, PlyMesh& mesh, TriangleData& triangles) {
  MeshPart part;
  part.positions = std::move(mesh.positions);
  part.normals = std::move(mesh.normals);
  part.colors = std::move(mesh.colors);
  part.uvs = std::move(mesh.uvs);
  for (glm::vec2& uv : part.uvs) {
    cancel_point();
    uv = texel_uv(uv);
  }
  PolygonSink sink(name);
  std::vector<uint32_t> local;
  size_t first = 0;
  for (size_t face = 0; face < mesh.face_sizes.size(); ++face) {
    const size_t size = mesh.face_sizes[face];
    local.clear();
    VOXELD_TRY(sink.add_face({mesh.corners.data() + first, size}, part,
                             mesh.corner_uvs.empty() ? nullptr : &local));
    for (size_t i = 2; i < size; ++i) {
      if (!mesh.face_colors.empty()) push_in_pieces(triangles.colors, mesh.face_colors[face]);
      if (!mesh.face_textures.empty()) push_in_pieces(triangles.textures, mesh.face_textures[face]);
    }
    if (!mesh.face_textures.empty() && mesh.face_textures[face] < 0) {
      triangles.any_without_texture = true;
    }
    for (const uint32_t corner : local) {
      push_in_pieces(triangles.corner_uvs, texel_uv(mesh.corner_uvs[first + corner]));
    }
    first += size;
  }
  complete_normals(part.positions, part.indices, part.normals);
  return part;
}

// Splits the part by texture. `part` must be unshared.
std::vector<MeshPart> split_by_texture(MeshPart part, const std::vector<int>& textures,
                                       size_t texture_count) {
  std::vector<MeshPart> parts;
  std::map<int, size_t> part_of_texture;
  for (size_t i = 0; i < textures.size(); ++i) {
    cancel_point();
    const int texture = textures[i] < static_cast<int>(texture_count) ? textures[i] : 0;
    const auto [found, is_new] = part_of_texture.try_emplace(texture, parts.size());
    if (is_new) parts.emplace_back().material = texture;
    MeshPart& out = parts[found->second];
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) {
      push_in_pieces(out.indices, static_cast<uint32_t>(out.positions.size()));
      push_in_pieces(out.positions, part.positions[k]);
      if (texture >= 0) push_in_pieces(out.uvs, part.uvs[k]);
      if (!part.normals.empty()) push_in_pieces(out.normals, part.normals[k]);
      if (!part.colors.empty()) push_in_pieces(out.colors, part.colors[k]);
    }
  }
  return parts;
}

std::vector<MeshPart> parts_of(MeshPart part, TriangleData triangles, size_t texture_count) {
  if (!triangles.colors.empty() && part.colors.empty()) {
    part = with_triangle_colors(part, triangles.colors);
  } else if (!triangles.corner_uvs.empty()) {
    part = unshared(part);
  }
  if (!triangles.corner_uvs.empty()) part.uvs = std::move(triangles.corner_uvs);
  std::vector<MeshPart> parts;
  const bool has_choice =
      texture_count > 1 || (texture_count == 1 && triangles.any_without_texture);
  if (has_choice && !triangles.textures.empty() && !part.uvs.empty()) {
    if (part.positions.size() != part.indices.size()) part = unshared(part);
    return split_by_texture(std::move(part), triangles.textures, texture_count);
  }
  if (texture_count > 0 && !part.uvs.empty()) part.material = 0;
  parts.push_back(std::move(part));
  return parts;
}

Error no_faces(std::string_view name, const PlyHeader& header) {
  bool is_cloud = true;
  for (const char* faces : {"face", "tristrips", "trifans"}) {
    if (header.element(faces) != nullptr) is_cloud = false;
  }
  return empty_mesh(name, is_cloud ? "no faces: a point cloud" : "no faces");
}

}  // namespace

Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options) {
  VOXELD_ASSIGN(const PlyHeader header, read_ply_header(name, bytes));
  VOXELD_ASSIGN(PlyMesh mesh, read_ply_body(name, header, bytes));
  if (mesh.face_sizes.empty()) return no_faces(name, header);
  Scene scene;
  scene.format = "ply";
  warn_skipped_faces(scene, name, mesh.skipped_face_count);
  for (Warning& warning : mesh.warnings) {
    add_warning(scene, warning.code, std::move(warning.detail));
  }
  if (mesh.is_alpha_dropped) {
    add_warning(scene, "assumed-opaque",
                std::string(name) + ": alpha is 0 everywhere; the colours are taken as opaque");
  }
  TriangleData triangles;
  VOXELD_ASSIGN(MeshPart part, shared_part(name, mesh, triangles));
  const bool has_uvs = !part.uvs.empty() || !triangles.corner_uvs.empty();
  const size_t texture_count = has_uvs ? header.texture_files.size() : 0;
  scene.parts = parts_of(std::move(part), std::move(triangles), texture_count);
  TextureSet textures(scene, bundle, std::string(name), options);
  for (size_t i = 0; i < texture_count; ++i) {
    const std::string& file = header.texture_files[i];
    scene.materials.push_back({.name = file, .image = textures.image_index(file, name)});
  }
  prefer_textures(scene, name);
  return scene;
}

Result<Scene> load_ply(std::string_view name, std::span<const uint8_t> bytes) {
  const std::unique_ptr<Bundle> bundle = single_file_bundle(std::string(name), bytes);
  return load_ply(name, bytes, *bundle, {});
}

}  // namespace voxeld
