// The statements of a Wavefront OBJ file as plain arrays, before they become a Scene.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "proto/job.h"
#include "proto/result.h"

namespace voxeld {

// Corner numbers count from 0; kNone: not given.
struct ObjCorner {
  static constexpr uint32_t kNone = UINT32_MAX;
  uint32_t v = kNone, vt = kNone, vn = kNone;
};

// What "o", "g" and "usemtl" say where a face stands.
struct ObjState {
  uint32_t name = 0;               // the last one's of both; index into ObjFile::names
  uint32_t object = 0, group = 0;  // likewise
  uint32_t material = 0;           // index into ObjFile::materials
  bool operator<(const ObjState& other) const {
    return std::tie(name, object, group, material) <
           std::tie(other.name, other.object, other.group, other.material);
  }
};

struct ObjFace {
  uint32_t corner_count;  // >= 3; its corners follow those of the face before
  uint32_t state;         // index into ObjFile::states
  uint32_t line;          // where it stands, for errors
};

struct ObjFile {
  std::vector<glm::dvec3> positions;
  // As written, or alpha 1; negative where a vertex has none; empty, or as long as positions.
  std::vector<glm::vec4> colors;
  float color_max = 0.0f;          // of all components
  std::vector<glm::vec2> uvs;      // as written: (0,0) is the bottom left
  std::vector<glm::vec3> normals;  // as written
  std::vector<ObjCorner> corners;  // every index is checked
  std::vector<ObjFace> faces;
  std::vector<ObjState> states;
  std::vector<std::string> names{""};      // of objects and groups; 0: none
  bool names_dropped = false;              // some faces are told apart by their material alone
  std::vector<std::string> materials{""};  // of "usemtl"; 0: none
  std::vector<std::string> libraries;      // "mtllib" lines as written, each once
  std::vector<std::string> ignored;        // keywords that were left out, each once
  std::vector<Warning> warnings;           // attributes that were dropped
};

// Reads all statements. v (with optional weight or colour), vt, vn, f, o, g, usemtl, mtllib count;
// points, lines, smoothing and the like are skipped; other words go to `ignored`. A backslash at
// the end of a line continues it. What is wrong with an attribute costs that attribute alone, with
// a warning: a texture coordinate or normal whose index is out of range or whose numbers are not
// finite is kNone in its corners, and such a colour is none. Errors: malformed-mesh with the line.
Result<ObjFile> read_obj_file(std::string_view name, std::string_view text);

}  // namespace voxeld
