// The elements of a PLY file as plain arrays, before they become a Scene.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/scene/ply/header.h"

namespace voxeld {

// The data per vertex, per face and per corner. Each array is empty or complete.
struct PlyMesh {
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  // as written
  std::vector<glm::vec2> uvs;      // as written: (0,0) is the bottom left
  std::vector<glm::vec4> colors;   // linear light

  std::vector<uint32_t> corners;       // vertex numbers, each < positions.size()
  std::vector<uint32_t> face_sizes;    // corners per face, >= 3
  std::vector<glm::vec4> face_colors;  // linear light
  std::vector<glm::vec2> corner_uvs;   // "texcoord"; as written
  std::vector<int> face_textures;      // "texnumber"; -1: none
  int64_t skipped_face_count = 0;      // with fewer than 3 corners
  std::vector<Warning> warnings;
  bool is_alpha_dropped = false;  // it is 0 everywhere, so colours have alpha 1
};

// Reads all elements; unknown elements and properties are skipped. Colours are red, green and blue,
// or a grey, in sRGB. Where their type leaves two readings of their range, the largest value
// decides, and a warning says so. Elements tristrips and trifans become faces behind the others.
// Data behind the last element is left out with the warning "trailing-bytes".
// Errors: malformed-mesh with line or byte and element.
Result<PlyMesh> read_ply_body(std::string_view name, const PlyHeader& header,
                              std::span<const uint8_t> bytes);

}  // namespace voxeld
