// The material files of OBJ.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "server/scene/scene.h"

namespace voxeld {

// The part of a name before a comment, a word other than the first that begins with '#'. Names may
// hold such words themselves ("Material #25"), so the whole name is to be tried first.
std::string_view before_comment(std::string_view name);

// What voxeld takes of one "newmtl".
struct MtlMaterial {
  std::string name;                // as written, with what may be a comment
  std::optional<glm::vec3> kd;     // as written; sRGB
  std::optional<double> dissolve;  // "d": 1 is opaque
  std::optional<double> tr;        // "Tr": 0 is opaque; "d" wins
  std::string map_kd;              // file name as written, likewise; empty: none
  glm::vec2 map_scale{1.0f};       // "-s"
  glm::vec2 map_offset{0.0f};      // "-o"
  bool map_clamp = false;          // "-clamp on"
};

// Materials in the order of the file. Never fails: a statement that cannot be read is left out and
// becomes a warning "bad-material" in `scene`, for a mesh without its colours is better than none.
// Options of map_Kd that would change its colours are left out with "ignored-map-option".
std::vector<MtlMaterial> parse_mtl(std::string_view name, std::string_view text, Scene& scene);

// The Material without its image. base_color is Kd taken as sRGB, made linear; white where Kd is
// not given, and where it is black under a texture (many exporters write that, and the product
// would be black). Alpha is d, else 1 - Tr; a material that would be wholly transparent is taken as
// opaque with the warning "assumed-opaque", as exporters disagree on which end of Tr is which.
Material material_of(const MtlMaterial& mtl, Scene& scene);

}  // namespace voxeld
