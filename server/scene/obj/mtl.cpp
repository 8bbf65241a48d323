#include "server/scene/obj/mtl.h"

#include <algorithm>
#include <utility>

#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

// Options of texture statements with the number of values that follow. -o, -s and -t take up to 3.
struct MapOption {
  std::string_view name;
  int value_count;
};
constexpr MapOption kMapOptions[] = {
    {"-blendu", 1}, {"-blendv", 1},  {"-boost", 1}, {"-mm", 2},   {"-texres", 1},    {"-clamp", 1},
    {"-bm", 1},     {"-imfchan", 1}, {"-cc", 1},    {"-type", 1}, {"-colorspace", 1}};

// Bytes of a statement. Longer ones are left out, with a warning.
constexpr size_t kMtlStatementBytesMax = 65'536;

class MtlReader {
 public:
  MtlReader(std::string_view name, std::string_view text, Scene& scene)
      : name_(name), cursor_(text), scene_(scene) {}

  std::vector<MtlMaterial> read() {
    while (cursor_.bytes_left() > 0) {
      const std::string_view statement = cursor_.rest_of_line();
      if (statement.size() > kMtlStatementBytesMax) {
        warn_long(statement);
        continue;
      }
      LineCursor words(statement);
      read_statement(words);
    }
    return std::move(materials_);
  }

 private:
  void read_statement(LineCursor& words) {
    const std::string_view keyword = words.token();
    if (keyword == "newmtl") {
      // The name is the rest of the line: it may contain blanks and '#'.
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
      material.map_kd = read_map("map_Kd", words, material.map_kd_options);
    } else if (equals_ignoring_case(keyword, "map_d")) {
      material.map_d = read_map("map_d", words, material.map_d_options);
      material.map_d_channel = imfchan_;
    } else if (is_other_map(keyword)) {
      material.other_maps.emplace_back(words.rest());
    }
  }

  static bool is_other_map(std::string_view keyword) {
    if (equals_ignoring_case(keyword.substr(0, 4), "map_")) {
      return !equals_ignoring_case(keyword, "map_Ka");  // some programs write it for map_Kd
    }
    for (const std::string_view known : {"bump", "norm", "disp", "decal", "refl"}) {
      if (equals_ignoring_case(keyword, known)) return true;
    }
    return false;
  }

  void warn(std::string_view what, std::string_view got) {
    add_warning(scene_, "bad-material",
                malformed_line(name_, cursor_.line(), what, "numbers", shown(got)).message());
  }

  void warn_long(std::string_view statement) {
    const std::string where = "line " + std::to_string(cursor_.line());
    add_warning(scene_, "bad-material",
                over_limit(name_, where, "too many bytes of a statement",
                           int64_t{kMtlStatementBytesMax}, static_cast<int64_t>(statement.size()))
                    .message());
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
    // A single number is used for all three components.
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

  // Reads the options of map_Kd or map_d; returns the file's name.
  std::string_view read_map(std::string_view map, LineCursor words, MapOptions& options) {
    map_ = map;
    imfchan_ = 0;
    options = {};
    for (;;) {
      LineCursor ahead = words;
      const std::string_view word = ahead.token();
      if (word.empty() || word[0] != '-' || !read_map_option(word, ahead, options)) break;
      words = ahead;
    }
    // The rest is the file's name, which may contain blanks.
    return words.rest();
  }

  // Reads the values of one option. Returns false if the word is not an option.
  bool read_map_option(std::string_view option, LineCursor& words, MapOptions& options) {
    if (option == "-o" || option == "-s" || option == "-t") {
      glm::vec2 value{option == "-s" ? 1.0f : 0.0f};
      for (int i = 0; i < 3; ++i) {
        LineCursor ahead = words;
        const auto number = parse_number_or_nan(ahead.token());
        if (!number) break;
        if (i < 2 && is_coordinate(*number)) value[i] = static_cast<float>(*number);
        words = ahead;
      }
      if (option == "-o") options.offset = value;
      if (option == "-s") options.scale = value;
      return true;
    }
    const auto* known =
        std::find_if(std::begin(kMapOptions), std::end(kMapOptions),
                     [&](const MapOption& candidate) { return candidate.name == option; });
    if (known == std::end(kMapOptions)) return false;
    std::string_view first, second;
    if (known->value_count > 0) first = words.token();
    if (known->value_count > 1) second = words.token();
    if (option == "-imfchan" && !first.empty()) imfchan_ = first[0];
    if (option == "-clamp") options.clamp = first == "on";
    if (option == "-mm" && (parse_number(first) != 0.0 || parse_number(second) != 1.0)) {
      warn_map(std::string(option) + " " + std::string(first) + " " + std::string(second),
               "as it is");
    }
    if (option == "-colorspace" && map_ == "map_Kd" && !equals_ignoring_case(first, "sRGB")) {
      warn_map(std::string(option) + " " + std::string(first), "as sRGB");
    }
    return true;
  }

  void warn_map(const std::string& option, std::string_view taken) {
    add_warning(scene_, "ignored-map-option",
                std::string(name_) + " line " + std::to_string(cursor_.line()) + ": " +
                    std::string(map_) + " " + option + ": the texture is taken " +
                    std::string(taken));
  }

  std::string_view name_;
  TextCursor cursor_;
  Scene& scene_;
  std::vector<MtlMaterial> materials_;
  std::string_view map_;  // the keyword of the map that was read last
  char imfchan_ = 0;      // its channel
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

std::string_view before_comment(std::string_view name) {
  LineCursor words(name);
  words.token();
  for (std::string_view word = words.token(); !word.empty(); word = words.token()) {
    if (word[0] == '#')
      return trimmed(name.substr(0, static_cast<size_t>(word.data() - name.data())));
  }
  return name;
}

std::vector<MtlMaterial> parse_mtl(std::string_view name, std::string_view text, Scene& scene) {
  return MtlReader(name, text, scene).read();
}

Material material_of(const MtlMaterial& mtl, Scene& scene) {
  Material material;
  material.name = mtl.name;
  glm::vec3 kd = mtl.kd ? linear_from_srgb(*mtl.kd) : glm::vec3(1.0f);
  if (kd == glm::vec3(0.0f) && !mtl.map_kd.empty()) kd = glm::vec3(1.0f);
  material.base_color = glm::vec4(kd, alpha_of(mtl, scene));
  if (mtl.map_options().clamp) material.wrap_u = material.wrap_v = Wrap::kClamp;
  if (!mtl.map_kd.empty() && !mtl.map_d.empty() && mtl.map_d_options != mtl.map_kd_options) {
    add_warning(scene, "ignored-map-option",
                "material " + shown(mtl.name) +
                    ": map_d: -s, -o and -clamp differ from those of map_Kd, which are used");
  }
  return material;
}

}  // namespace voxeld
