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

// The options of a texture statement that say how the texture lies.
struct MapOptions {
  glm::vec2 scale{1.0f};   // "-s"
  glm::vec2 offset{0.0f};  // "-o"
  bool clamp = false;      // "-clamp on"
  bool operator==(const MapOptions&) const = default;
};

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
  char map_d_channel = 0;  // of map_d's "-imfchan": r, g, b, m or l; 0: none is given
  MapOptions map_kd_options, map_d_options;
  // How the material's texture lies: one that is made of both maps lies as map_Kd does.
  const MapOptions& map_options() const { return map_kd.empty() ? map_d_options : map_kd_options; }
};

// Reads materials in the order of the file. It never fails, because a mesh without its colours is
// better than none: a broken statement is ignored with the warning "bad-material" in `scene`.
// Options of maps that would change their texels are ignored with "ignored-map-option".
std::vector<MtlMaterial> parse_mtl(std::string_view name, std::string_view text, Scene& scene);

// The Material without its image. base_color is Kd, taken as sRGB and made linear. It is white if
// Kd is absent, or if it is black under a texture: many exporters write that, and the product would
// be black. Alpha is d, else 1 - Tr. A wholly transparent material is taken as opaque with the
// warning "assumed-opaque", because exporters disagree on which end of Tr is which. If options of
// map_d differ from those of map_Kd, they are ignored with "ignored-map-option".
Material material_of(const MtlMaterial& mtl, Scene& scene);

}  // namespace voxeld
