#include "server/worker/device/self_test_scene.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include <glm/geometric.hpp>

namespace voxeld {
namespace {

constexpr int kRings = 20, kSpokes = 40;  // of the sphere: 1520 triangles of about two voxels
constexpr int kImageSide = 32;

// Adds a vertex with a colour, a normal and a place in the texture.
void add_vertex(MeshPart& part, const glm::dvec3& position, const glm::dvec3& normal,
                const glm::dvec2& uv) {
  part.positions.push_back(position);
  part.normals.emplace_back(normal);
  part.uvs.emplace_back(uv);
  const auto shade = static_cast<float>(0.2 + 0.7 * uv.x);
  part.colors.emplace_back(shade, 0.5f, 1.0f - shade, 1.0f);
}

MeshPart sphere(const glm::dvec3& center, double radius) {
  MeshPart part;
  part.name = "sphere";
  for (int ring = 0; ring <= kRings; ++ring) {
    for (int spoke = 0; spoke <= kSpokes; ++spoke) {
      const double theta = std::numbers::pi * ring / kRings;
      // The last spoke is the first again, to the bit, so that the mesh closes.
      const double phi = 2.0 * std::numbers::pi * (spoke % kSpokes) / kSpokes;
      const bool is_pole = ring == 0 || ring == kRings;
      const double across = is_pole ? 0.0 : std::sin(theta);
      const double up = ring == 0 ? 1.0 : ring == kRings ? -1.0 : std::cos(theta);
      const glm::dvec3 normal(across * std::cos(phi), up, across * std::sin(phi));
      add_vertex(part, center + radius * normal, normal,
                 {double{1} * spoke / kSpokes, double{1} * ring / kRings});
    }
  }
  for (int ring = 0; ring < kRings; ++ring) {
    for (int spoke = 0; spoke < kSpokes; ++spoke) {
      const auto a = static_cast<uint32_t>(ring * (kSpokes + 1) + spoke);
      const uint32_t b = a + kSpokes + 1;
      if (ring > 0) part.indices.insert(part.indices.end(), {a, a + 1, b + 1});
      if (ring + 1 < kRings) part.indices.insert(part.indices.end(), {a, b + 1, b});
    }
  }
  return part;
}

// A sheared box across both tiles.
MeshPart box() {
  MeshPart part;
  part.name = "box";
  part.node = 1;
  part.mesh = 1;
  std::array<glm::dvec3, 8> corners{};
  for (size_t i = 0; i < corners.size(); ++i) {
    const double x = (i & 1) != 0 ? 291.3 : 57.7, y = (i & 2) != 0 ? 31.9 : 6.2;
    corners[i] = {x, y + 0.04 * (x - 57.7), (i & 4) != 0 ? 41.4 : 5.6};
  }
  constexpr std::array<std::array<size_t, 4>, 6> kFaces = {
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  constexpr std::array<glm::dvec2, 4> kUvs = {{{0, 0}, {5, 0}, {5, 3}, {0, 3}}};
  for (const auto& face : kFaces) {
    const auto first = static_cast<uint32_t>(part.positions.size());
    const glm::dvec3 normal = glm::normalize(
        glm::cross(corners[face[1]] - corners[face[0]], corners[face[2]] - corners[face[0]]));
    for (size_t k = 0; k < 4; ++k) add_vertex(part, corners[face[k]], normal, kUvs[k]);
    part.indices.insert(part.indices.end(),
                        {first, first + 1, first + 2, first, first + 2, first + 3});
  }
  return part;
}

Image pattern(bool is_translucent) {
  Image image;
  image.name = "pattern";
  image.width = image.height = kImageSide;
  for (int y = 0; y < kImageSide; ++y) {
    for (int x = 0; x < kImageSide; ++x) {
      const auto value = static_cast<uint8_t>((x * 37 + y * 91 + x * y) & 255);
      const auto alpha = static_cast<uint8_t>(is_translucent ? 255 - value / 2 : 255);
      image.rgba.insert(image.rgba.end(),
                        {value, static_cast<uint8_t>(8 * y), static_cast<uint8_t>(8 * x), alpha});
    }
  }
  return image;
}

Scene scene(const char* name, bool is_textured, bool is_translucent) {
  Scene scene;
  scene.format = name;
  scene.parts = {sphere({25.3, 23.6, 24.1}, 20.7), box()};
  scene.meshes = scene.nodes = {"sphere", "box"};
  scene.materials.resize(2);
  for (size_t i = 0; i < 2; ++i) {
    Material& material = scene.materials[i];
    material.name = scene.meshes[i];
    material.base_color = {0.9f, 0.8f, 0.7f, is_translucent ? 0.6f : 1.0f};
    if (is_textured) material.image = 0;
    scene.parts[i].material = static_cast<int>(i);
  }
  if (is_textured) scene.images.push_back(pattern(is_translucent));
  scene.colors_given = true;
  return scene;
}

}  // namespace

std::vector<Scene> self_test_scenes() {
  std::vector<Scene> scenes;
  scenes.reserve(4);
  scenes.push_back(scene("an opaque mesh", false, false));
  scenes.push_back(scene("a translucent mesh", false, true));
  scenes.push_back(scene("a textured mesh", true, false));
  scenes.push_back(scene("a textured translucent mesh", true, true));
  return scenes;
}

}  // namespace voxeld
