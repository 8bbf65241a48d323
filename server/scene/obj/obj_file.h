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

#include "proto/messages/job.h"
#include "proto/result.h"

namespace voxeld {

// A corner of a face. Numbers count from 0; kNone: absent.
struct ObjCorner {
  static constexpr uint32_t kNone = UINT32_MAX;
  uint32_t v = kNone, vt = kNone, vn = kNone;
};

// The names in force at a face, set by "o", "g" and "usemtl".
struct ObjState {
  uint32_t name = 0;               // of the last "o" or "g"; index into ObjFile::names
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
  uint32_t line;          // for errors
};

struct ObjFile {
  std::vector<glm::dvec3> positions;
  // As written, with alpha 1 if absent; negative for a vertex without colour. Empty, or as long as
  // positions.
  std::vector<glm::vec4> colors;
  float color_max = 0.0f;          // over all components
  std::vector<glm::vec2> uvs;      // as written: (0,0) is the bottom left
  std::vector<glm::vec3> normals;  // as written
  std::vector<ObjCorner> corners;  // every index is valid
  std::vector<ObjFace> faces;
  int64_t skipped_face_count = 0;  // with fewer than 3 corners
  std::vector<ObjState> states;
  std::vector<std::string> names{""};      // of objects and groups; 0: none
  bool names_dropped = false;              // some faces are separated by their material alone
  std::vector<std::string> materials{""};  // of "usemtl"; 0: none
  std::vector<std::string> libraries;      // "mtllib" lines as written, each once
  std::vector<std::string> ignored;        // ignored keywords, each once
  std::vector<Warning> warnings;           // about dropped attributes
};

// Reads all statements. v (with optional weight or colour), vt, vn, f, o, g, usemtl and mtllib are
// used. Points, lines, smoothing and the like are skipped; other words go to `ignored`. A backslash
// at the end of a line continues it, but not in a comment.
//
// A bad attribute costs only itself, with a warning. A texture coordinate or normal with an invalid
// index or with numbers that are not finite becomes kNone in its corners; such a colour is dropped.
// Errors: malformed-mesh with the line.
Result<ObjFile> read_obj_file(std::string_view name, std::string_view text);

}  // namespace voxeld
