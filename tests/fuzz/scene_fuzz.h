// The assertion of every fuzz target of the loaders: an error with a message, or a scene that the
// voxelizer can use without checks.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "server/base/check.h"
#include "server/scene/load.h"

namespace voxeld::fuzz {

inline void check_part(const Scene& scene, const MeshPart& part) {
  const size_t count = part.positions.size();
  VOXELD_CHECK(part.indices.size() % 3 == 0, "whole triangles");
  for (const uint32_t index : part.indices) VOXELD_CHECK(index < count, "index in range");
  for (const auto& p : part.positions) {
    VOXELD_CHECK(std::abs(p.x) <= 1e30 && std::abs(p.y) <= 1e30 && std::abs(p.z) <= 1e30,
                 "finite position");
  }
  for (const auto& color : part.colors) {
    for (int i = 0; i < 4; ++i)
      VOXELD_CHECK(color[i] >= 0.0f && color[i] <= 1.0f, "colour in 0..1");
  }
  VOXELD_CHECK(part.normals.empty() || part.normals.size() == count, "a normal per vertex");
  VOXELD_CHECK(part.uvs.empty() || part.uvs.size() == count, "a uv per vertex");
  VOXELD_CHECK(part.colors.empty() || part.colors.size() == count, "a colour per vertex");
  VOXELD_CHECK(part.material < static_cast<int>(scene.materials.size()), "material in range");
  VOXELD_CHECK(part.mesh < scene.meshes.size() && part.node < scene.nodes.size() &&
                   part.group < scene.groups.size(),
               "mesh, node and group in range");
}

inline int load(std::string_view filename, const uint8_t* data, size_t size) {
  const auto scene = load_scene(filename, {data, size}, {.decode_images = false});
  if (!scene) {
    VOXELD_CHECK(!scene.error().detail.empty(), "an error says what");
    VOXELD_CHECK(scene.error().code != ErrorCode::kInternal, "input is never an internal error");
    return 0;
  }
  VOXELD_CHECK(scene->triangle_count() > 0, "no empty scene");
  for (const MeshPart& part : scene->parts) check_part(*scene, part);
  for (const Material& material : scene->materials) {
    VOXELD_CHECK(material.image < static_cast<int>(scene->images.size()), "image in range");
  }
  return 0;
}

}  // namespace voxeld::fuzz
