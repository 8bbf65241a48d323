// A scene as plain data: loaders make it and the voxelizer reads it. All positions are in world
// space (node transforms applied), right-handed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "proto/messages/job.h"

namespace voxeld {

// A texture. Row 0 is the top row. Alpha is straight (not premultiplied). RGB is stored as in the
// file and taken as sRGB.
struct Image {
  std::string name;  // as the mesh file names it
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // 4 * width * height
};

enum class Wrap { kRepeat, kClamp, kMirror };

struct Material {
  std::string name;
  // linear light RGB, linear alpha; multiplies texture and vertex colour
  glm::vec4 base_color{1.0f};
  int image = -1;  // index into Scene::images; -1: none
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

// Triangles that share a material, with their names in the file. Attribute arrays are empty or as
// long as positions.
struct MeshPart {
  std::string name;
  int material = -1;  // index into Scene::materials; -1: none
  // indices into Scene::meshes, Scene::nodes and Scene::groups
  uint32_t mesh = 0, node = 0, group = 0;
  std::vector<glm::dvec3> positions;  // world units
  std::vector<glm::vec3> normals;     // unit length, world space
  // (0,0) is the top left texel corner; texture transforms applied
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec4> colors;  // linear light RGB, linear alpha
  std::vector<uint32_t> indices;  // 3 per triangle, each < positions.size(); counter-clockwise
};

struct Box3d {
  glm::dvec3 min{1e308}, max{-1e308};
  bool empty() const { return min.x > max.x; }
  void add(const glm::dvec3& p) {
    min = glm::min(min, p);
    max = glm::max(max, p);
  }
};

struct MissingFile {
  std::string name;       // as the mesh file names it
  std::string needed_by;  // material or file
};

struct Scene {
  std::string format;  // "ply", "obj", "stl", "off", "gltf", "glb"
  std::vector<MeshPart> parts;
  std::vector<Material> materials;
  // Names that parts refer to, in the order in which the file's surfaces first use them. A format
  // without such names has a single empty one.
  std::vector<std::string> meshes{""}, nodes{""}, groups{""};
  // Whether some parts hold surfaces of several names, because there were more than a scene has
  // parts.
  bool parts_merged = false;
  std::vector<Image> images;
  std::vector<Warning> warnings;
  std::vector<MissingFile> missing_files;

  size_t triangle_count() const;
  size_t vertex_count() const;
  // The box of the vertices that triangles use.
  Box3d bounds() const;
  // Whether the file has any colour: vertex colours, textures that were found, or a given base
  // colour. A mesh without it gets no colour channel.
  bool has_colors() const;
  bool colors_given = false;  // set by loaders when a material gives a base colour
};

}  // namespace voxeld
