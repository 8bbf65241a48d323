#include "server/scene/mtl.h"

#include <algorithm>
#include <utility>

#include "server/scene/color_space.h"
#include "server/scene/mesh_error.h"
#include "server/scene/text_cursor.h"

namespace voxeld {
namespace {

// Options of texture statements with the number of values that follow; -o, -s and -t take up to 3.
struct MapOption {
  std::string_view name;
  int value_count;
};
constexpr MapOption kMapOptions[] = {{"-blendu", 1}, {"-blendv", 1}, {"-boost", 1}, {"-mm", 2},
                                     {"-texres", 1}, {"-clamp", 1},  {"-bm", 1},    {"-imfchan", 1},
                                     {"-cc", 1},     {"-type", 1}};

class MtlReader {
 public:
  MtlReader(std::string_view name, std::string_view text, Scene& scene)
      : name_(name), cursor_(text), scene_(scene) {}

  std::vector<MtlMaterial> read() {
    while (cursor_.bytes_left() > 0) {
      LineCursor words(cursor_.rest_of_line());
      read_statement(words);
    }
    return std::move(materials_);
  }

 private:
  void read_statement(LineCursor& words) {
    const std::string_view keyword = words.token();
    if (keyword == "newmtl") {
      // Names may hold blanks and '#'.
      materials_.emplace_back().name = words.rest();
      return;
    }
    if (materials_.empty()) return;
    MtlMaterial& material = materials_.back();
    if (keyword == "Kd") {
      read_kd(words, material);
    } else if (keyword == "d") {
      material.dissolve = read_factor(keyword, words);
    } else if (keyword == "Tr") {
      material.tr = read_factor(keyword, words);
    } else if (equals_ignoring_case(keyword, "map_Kd")) {
      read_map(words, material);
    }
  }

  void warn(std::string_view what, std::string_view got) {
    add_warning(scene_, "bad-material",
                malformed_line(name_, cursor_.line(), what, "numbers", shown(got)).message());
  }

  void read_kd(LineCursor& words, MtlMaterial& material) {
    glm::vec3 kd{0.0f};
    int count = 0;
    for (std::string_view word = words.token(); !word.empty() && count < 3; word = words.token()) {
      const auto number = parse_number(word);
      if (!number) return warn("Kd", word);
      kd[count++] = static_cast<float>(*number);
    }
    if (count == 0) return warn("Kd", "");
    // One number stands for all three.
    for (; count < 3; ++count) kd[count] = kd[0];
    material.kd = kd;
  }

  std::optional<double> read_factor(std::string_view keyword, LineCursor& words) {
    std::string_view word = words.token();
    if (word == "-halo") word = words.token();
    const auto number = parse_number(word);
    if (!number) warn(keyword, word);
    return number;
  }

  static void read_map(LineCursor words, MtlMaterial& material) {
    for (;;) {
      LineCursor ahead = words;
      const std::string_view word = ahead.token();
      if (word.empty() || word[0] != '-' || !read_map_option(word, ahead, material)) break;
      words = ahead;
    }
    // All that is left is the name: it may hold blanks.
    material.map_kd = words.rest();
  }

  // Reads the values of one option; false for a word that is no option.
  static bool read_map_option(std::string_view option, LineCursor& words, MtlMaterial& material) {
    if (option == "-o" || option == "-s" || option == "-t") {
      glm::vec2 value{option == "-s" ? 1.0f : 0.0f};
      for (int i = 0; i < 3; ++i) {
        LineCursor ahead = words;
        const auto number = parse_number(ahead.token());
        if (!number) break;
        if (i < 2) value[i] = static_cast<float>(*number);
        words = ahead;
      }
      if (option == "-o") material.map_offset = value;
      if (option == "-s") material.map_scale = value;
      return true;
    }
    const auto* known =
        std::find_if(std::begin(kMapOptions), std::end(kMapOptions),
                     [&](const MapOption& candidate) { return candidate.name == option; });
    if (known == std::end(kMapOptions)) return false;
    for (int i = 0; i < known->value_count; ++i) {
      const std::string_view value = words.token();
      if (option == "-clamp") material.map_clamp = value == "on";
    }
    return true;
  }

  std::string_view name_;
  TextCursor cursor_;
  Scene& scene_;
  std::vector<MtlMaterial> materials_;
};

float alpha_of(const MtlMaterial& mtl, Scene& scene) {
  if (!mtl.dissolve && !mtl.tr) return 1.0f;
  const auto alpha = unit_clamped(static_cast<float>(mtl.dissolve ? *mtl.dissolve : 1.0 - *mtl.tr));
  if (alpha > 0.0f) return alpha;
  add_warning(scene, "assumed-opaque",
              "material " + shown(mtl.name) + " would be wholly transparent; taken as opaque");
  return 1.0f;
}

}  // namespace

std::vector<MtlMaterial> parse_mtl(std::string_view name, std::string_view text, Scene& scene) {
  return MtlReader(name, text, scene).read();
}

Material material_of(const MtlMaterial& mtl, Scene& scene) {
  Material material;
  material.name = mtl.name;
  glm::vec3 kd = mtl.kd ? linear_from_srgb(*mtl.kd) : glm::vec3(1.0f);
  if (kd == glm::vec3(0.0f) && !mtl.map_kd.empty()) kd = glm::vec3(1.0f);
  material.base_color = glm::vec4(kd, alpha_of(mtl, scene));
  if (mtl.map_clamp) material.wrap_u = material.wrap_v = Wrap::kClamp;
  return material;
}

}  // namespace voxeld
