// Reads MTL, the material files of OBJ.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "server/scene/core/scene.h"

namespace voxeld {

// The part of a name before a comment, which is a word other than the first that begins with '#'.
// Names may contain such words themselves ("Material #25"), so try the whole name first.
std::string_view before_comment(std::string_view name);

// The members of one "newmtl" that voxeld uses.
struct MtlMaterial {
  std::string name;                // as written, including a possible comment
  std::optional<glm::vec3> kd;     // as written; sRGB
  std::optional<double> dissolve;  // "d": 1 is opaque
  std::optional<double> tr;        // "Tr": 0 is opaque; "d" wins
  std::string map_kd;              // file name as written, including a possible comment; empty:
                                   // none
  std::string map_d;               // likewise
  // The text, as written, of statements that give no colour, such as map_Bump.
  std::vector<std::string> other_maps;
  char map_d_channel = 0;      // of map_d's "-imfchan": r, g, b, m or l; 0: none is given
  glm::vec2 map_scale{1.0f};   // "-s"
  glm::vec2 map_offset{0.0f};  // "-o"
  bool map_clamp = false;      // "-clamp on"
};

// Reads materials in the order of the file. It never fails, because a mesh without its colours is
// better than none: a broken statement is ignored with the warning "bad-material" in `scene`.
// Options of map_Kd that would change its colours are ignored with "ignored-map-option". map_d lies
// as map_Kd does, whatever its own options are.
std::vector<MtlMaterial> parse_mtl(std::string_view name, std::string_view text, Scene& scene);

// The Material without its image. base_color is Kd, taken as sRGB and made linear. It is white if
// Kd is absent, or if it is black under a texture: many exporters write that, and the product would
// be black. Alpha is d, else 1 - Tr. A wholly transparent material is taken as opaque with the
// warning "assumed-opaque", because exporters disagree on which end of Tr is which.
Material material_of(const MtlMaterial& mtl, Scene& scene);

}  // namespace voxeld
