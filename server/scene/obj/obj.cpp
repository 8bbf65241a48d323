// Converts OBJ to a Scene: parts by object, group, material and kind of corner; shared vertices by
// (v, vt, vn). An object ("o") is a mesh and a node. Faces outside any object or group ("g") belong
// to one without a name.
//
// Vertex colours ("v x y z r g b") are taken as sRGB, and as 0..255 if any component of the file is
// above kUnitColorMax. Texture coordinates are flipped: OBJ's origin is the bottom left.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <glm/geometric.hpp>

#include "proto/file_names/file_names.h"
#include "proto/text/text_file.h"
#include "server/base/pieces.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/name_list.h"
#include "server/scene/core/polygon_sink.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/core/vertex_table.h"
#include "server/scene/images/textures.h"
#include "server/scene/obj/mtl.h"
#include "server/scene/obj/obj_file.h"

namespace voxeld {
namespace {

constexpr float kUnitColorMax = 1.5f;
// Look-ups that a file may cause: material files in all "mtllib" lines, words of an absent one, and
// words of a texture statement behind unknown options. Further ones are not tried.
constexpr size_t kLibraryNamesMax = 100;
constexpr size_t kLibraryNameWordsMax = 16;
constexpr size_t kMapWordsMax = 16;
constexpr size_t kOtherMapsMax = 1000;

class ObjLoader {
 public:
  ObjLoader(std::string_view name, ObjFile file, const Bundle& bundle, const LoadOptions& options)
      : name_(name),
        file_(std::move(file)),
        bundle_(bundle),
        textures_(scene_, bundle, std::string(name), options),
        sink_(name),
        table_(std::min(file_.positions.size(), file_.corners.size())) {}

  Result<Scene> load() {
    scene_.format = "obj";
    for (const std::string& word : file_.ignored) {
      add_warning(scene_, "ignored-statement",
                  std::string(name_) + ": statements " + shown(word) + " were left out");
    }
    for (Warning& warning : file_.warnings) {
      add_warning(scene_, warning.code, std::move(warning.detail));
    }
    warn_skipped_faces(scene_, name_, file_.skipped_face_count);
    if (file_.faces.empty()) {
      return empty_mesh(
          name_, file_.skipped_face_count == 0 ? "no faces" : "only faces of one or two corners");
    }
    read_libraries();
    color_scale_ = file_.color_max > kUnitColorMax ? 1.0f / 255.0f : 1.0f;
    const ObjCorner* corner = file_.corners.data();
    for (const ObjFace& face : file_.faces) {
      VOXELD_TRY(add_face(face, {corner, face.corner_count}));
      corner += face.corner_count;
    }
    assume_texture();
    prefer_textures(scene_, name_);
    free_in_pieces(file_.positions);
    free_in_pieces(file_.colors);
    free_in_pieces(file_.uvs);
    free_in_pieces(file_.normals);
    free_in_pieces(file_.corners);
    free_in_pieces(file_.faces);
    scene_.nodes = scene_.meshes;
    scene_.parts_merged = file_.names_dropped;
    return std::move(scene_);
  }

 private:
  struct PartKey {
    uint32_t state;
    bool has_uv, has_normal;
    bool operator==(const PartKey&) const = default;
    bool operator<(const PartKey& other) const {
      return std::tie(state, has_uv, has_normal) <
             std::tie(other.state, other.has_uv, other.has_normal);
    }
  };

  void read_libraries() {
    for (const std::string& line : file_.libraries) {
      for (const std::string_view name : library_names(line)) {
        if (library_name_count_++ == kLibraryNamesMax) return;
        read_libraries_of(name);
      }
    }
  }

  // The file names of an "mtllib" line. Each may contain blanks and ends with ".mtl" or with the
  // line. A comment may follow.
  static std::vector<std::string_view> library_names(std::string_view line) {
    std::vector<std::string_view> names;
    size_t begin = line.npos;  // of the next name
    LineCursor words(line);
    for (std::string_view word = words.token(); !word.empty(); word = words.token()) {
      const auto at = static_cast<size_t>(word.data() - line.data());
      if (begin == line.npos) {
        if (!names.empty() && word[0] == '#') return names;
        begin = at;
      }
      const std::string_view end = word.substr(word.size() - std::min<size_t>(word.size(), 4));
      if (!equals_ignoring_case(end, ".mtl")) continue;
      names.push_back(line.substr(begin, at + word.size() - begin));
      begin = line.npos;
    }
    if (begin != line.npos) names.push_back(trimmed(line.substr(begin)));
    return names;
  }

  // Reads one name, or, if no such file exists, each of its words.
  void read_libraries_of(std::string_view name) {
    if (read_library(name)) return;
    name = before_comment(name);
    std::vector<std::string_view> missing;
    size_t word_count = 0;
    LineCursor words(name);
    for (std::string_view word = words.token(); !word.empty(); word = words.token()) {
      if (++word_count > kLibraryNameWordsMax) break;
      if (!read_library(word)) missing.push_back(word);
    }
    // If no word is found, the whole text is the better name for the missing file.
    if (missing.size() == word_count) missing.assign(1, name);
    for (const std::string_view word : missing) missing_library(word);
  }

  bool read_library(std::string_view reference) {
    const auto bytes = bundle_.find(reference, name_);
    if (!bytes) {
      add_warning(scene_, "broken-material-file",
                  std::string(reference) + ": " + bytes.error().message());
      scene_.missing_files.push_back({std::string(reference), std::string(name_)});
      return true;
    }
    if (!*bytes) return false;
    warn_assumed_file(scene_, bundle_, reference, name_, name_);
    std::string storage;
    for (MtlMaterial& material : parse_mtl(reference, plain_text(**bytes, storage), scene_)) {
      std::string key = material.name;
      library_.emplace(std::move(key), std::move(material));
    }
    return true;
  }

  // The material that "usemtl" means; null if there is none.
  const MtlMaterial* find_material(std::string_view name) {
    for (const std::string_view candidate : {name, before_comment(name)}) {
      const auto found = library_.find(candidate);
      if (found != library_.end()) return &found->second;
    }
    if (by_short_name_.empty()) {
      for (const auto& [full, material] : library_) {
        by_short_name_.emplace(before_comment(full), &material);
      }
    }
    const auto found = by_short_name_.find(before_comment(name));
    return found == by_short_name_.end() ? nullptr : found->second;
  }

  // The file that a texture statement names: the whole text if the upload has it, otherwise without
  // a trailing comment and without leading unknown options.
  std::string_view texture_name(std::string_view text) const {
    std::string_view left = text;
    for (size_t i = 0; i < kMapWordsMax && !left.empty(); ++i) {
      for (const std::string_view candidate : {left, before_comment(left)}) {
        if (bundle_.resolve(candidate, name_)) return candidate;
      }
      if (text[0] != '-') break;
      LineCursor words(left);
      words.token();
      left = words.rest();
    }
    return before_comment(text);
  }

  void missing_library(std::string_view reference) {
    if (reference.empty()) return;
    add_warning(
        scene_, "missing-material-file",
        std::string(reference) + ", named by " + std::string(name_) + ", is not in the upload");
    scene_.missing_files.push_back({std::string(reference), std::string(name_)});
  }

  // Index into scene_.materials of the file's material. Only used materials are added.
  int material_index(uint32_t number) {
    if (number == 0) return -1;
    const std::string_view written = file_.materials[number];
    const MtlMaterial* mtl = find_material(written);
    const std::string material_name(
        mtl != nullptr && mtl->name == written ? written : before_comment(written));
    const auto [found, is_new] = material_indices_.try_emplace(material_name, 0);
    if (!is_new) return found->second;
    Material material;
    if (mtl == nullptr) {
      material.name = material_name;
      add_warning(scene_, "missing-material",
                  std::string(name_) + ": material " + shown(material_name) +
                      " is in none of its material files; taken as white");
    } else {
      material = material_of(*mtl, scene_);
      material.name = material_name;
      if (mtl->kd) scene_.colors_given = true;
      any_map_ = any_map_ || !mtl->map_kd.empty() || !mtl->map_d.empty();
      const std::string needed_by = "material " + shown(material_name);
      if (!mtl->map_kd.empty()) {
        material.image = textures_.image_index(texture_name(mtl->map_kd), needed_by);
      }
      if (!mtl->map_d.empty()) {
        const int opacity = textures_.image_index(texture_name(mtl->map_d), needed_by);
        material.image =
            textures_.with_opacity(material.image, opacity, mtl->map_d_channel, needed_by);
      }
    }
    scene_.materials.push_back(std::move(material));
    return found->second = static_cast<int>(scene_.materials.size()) - 1;
  }

  uint32_t part_index(const PartKey& key) {
    const auto [found, is_new] =
        part_indices_.try_emplace(key, static_cast<uint32_t>(scene_.parts.size()));
    if (is_new) {
      const ObjState& state = file_.states[key.state];
      const int material = material_index(state.material);
      MeshPart& part = scene_.parts.emplace_back();
      part.name = file_.names[state.name].substr(0, kPartNameBytesMax);
      part.material = material;
      part.mesh = meshes_.index_of(state.object, [&] { return file_.names[state.object]; });
      part.node = part.mesh;
      part.group = groups_.index_of(state.group, [&] { return file_.names[state.group]; });
      maps_.push_back(find_material(file_.materials[state.material]));
    }
    return found->second;
  }

  Status add_face(const ObjFace& face, std::span<const ObjCorner> corners) {
    PartKey key{face.state, true, true};
    for (const ObjCorner& corner : corners) {
      key.has_uv &= corner.vt != ObjCorner::kNone;
      key.has_normal &= corner.vn != ObjCorner::kNone && is_normal(file_.normals[corner.vn]);
    }
    if (!last_key_ || *last_key_ != key) {
      last_key_ = key;
      last_part_ = part_index(key);
    }
    face_.clear();
    for (const ObjCorner& corner : corners) face_.push_back(vertex_index(key, corner));
    return sink_.add_face(face_, scene_.parts[last_part_]);
  }

  static bool is_normal(const glm::vec3& n) {
    const float square = glm::dot(n, n);
    return square > 0.0f && square < 1e30f;
  }

  uint32_t vertex_index(const PartKey& key, const ObjCorner& corner) {
    MeshPart& part = scene_.parts[last_part_];
    const uint32_t vt = key.has_uv ? corner.vt : ObjCorner::kNone;
    const uint32_t vn = key.has_normal ? corner.vn : ObjCorner::kNone;
    const auto next = static_cast<uint32_t>(part.positions.size());
    const auto [index, is_new] = table_.find_or_add({corner.v, vt, vn, last_part_}, next);
    if (!is_new) return index;
    push_in_pieces(part.positions, file_.positions[corner.v]);
    if (key.has_uv) push_in_pieces(part.uvs, texel_uv(file_.uvs[vt], maps_[last_part_]));
    if (key.has_normal) push_in_pieces(part.normals, glm::normalize(file_.normals[vn]));
    if (!file_.colors.empty()) push_in_pieces(part.colors, vertex_color(corner.v));
    return next;
  }

  // Applies "-s" and "-o" of the material's texture, then moves the origin from bottom left to top
  // left.
  static glm::vec2 texel_uv(glm::vec2 uv, const MtlMaterial* mtl) {
    if (mtl != nullptr) uv = uv * mtl->map_options().scale + mtl->map_options().offset;
    if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) uv = glm::vec2(0.0f);
    return {uv.x, 1.0f - uv.y};
  }

  // In a file with some vertex colours, vertices without one are white.
  glm::vec4 vertex_color(uint32_t v) const {
    if (v >= file_.colors.size() || file_.colors[v].x < 0.0f) return glm::vec4(1.0f);
    const glm::vec4 color = file_.colors[v] * color_scale_;
    const float alpha = file_.colors[v].w > 1.0f ? color.w : file_.colors[v].w;
    return {linear_from_srgb(glm::vec3(color)), unit_clamped(alpha)};
  }

  // The use of an image by the statements of the material files.
  enum class ImageUse { kNone, kColor, kOther };
  ImageUse use_of(const std::string& image) const {
    size_t count = 0;
    const auto is_it = [&](const std::string& text) {
      if (text.empty() || ++count > kOtherMapsMax) return false;
      const auto found = bundle_.resolve(texture_name(text), name_);
      return found && bundle_.entries()[found->index].name == image;
    };
    ImageUse use = ImageUse::kNone;
    for (const auto& [name, material] : library_) {
      for (const std::string& text : material.other_maps) {
        if (is_it(text)) return ImageUse::kOther;
      }
      if (is_it(material.map_kd) || is_it(material.map_d)) use = ImageUse::kColor;
    }
    return use;
  }

  void assume_texture() {
    if (any_map_) return;
    const std::optional<std::string> image_name = only_image(bundle_);
    if (!image_name) return;
    const ImageUse use = use_of(*image_name);
    if (use == ImageUse::kOther) return;
    int image = -1;
    int plain_material = -1;
    for (size_t p = 0; p < scene_.parts.size(); ++p) {
      MeshPart& part = scene_.parts[p];
      // The texture of other materials is not that of one which is there and has none.
      if (part.uvs.empty() || (use == ImageUse::kColor && maps_[p] != nullptr)) continue;
      if (image < 0) image = textures_.image_index(*image_name, name_);
      if (image < 0) return;
      if (part.material < 0 && plain_material < 0) {
        plain_material = static_cast<int>(scene_.materials.size());
        scene_.materials.push_back({.name = std::string(base_name(*image_name))});
      }
      if (part.material < 0) part.material = plain_material;
      scene_.materials[static_cast<size_t>(part.material)].image = image;
    }
    if (image < 0) return;
    add_warning(scene_, "assumed-texture",
                std::string(name_) + " names no texture; " + *image_name +
                    ", the only image of the upload, is used");
  }

  std::string_view name_;
  ObjFile file_;
  const Bundle& bundle_;
  Scene scene_;
  TextureSet textures_;
  PolygonSink sink_;
  NameList<uint32_t> meshes_{scene_.meshes}, groups_{scene_.groups};
  size_t library_name_count_ = 0;
  std::map<std::string, MtlMaterial, std::less<>> library_;
  std::map<std::string_view, const MtlMaterial*> by_short_name_;  // without comments
  std::map<std::string, int> material_indices_;                   // by name
  std::map<PartKey, uint32_t> part_indices_;
  std::vector<const MtlMaterial*> maps_;  // per part
  std::optional<PartKey> last_key_;
  uint32_t last_part_ = 0;
  VertexTable table_;
  std::vector<uint32_t> face_;
  bool any_map_ = false;
  float color_scale_ = 1.0f;
};

}  // namespace

Result<Scene> load_obj(std::string_view name, std::span<const uint8_t> bytes, const Bundle& bundle,
                       const LoadOptions& options) {
  std::string storage;
  VOXELD_ASSIGN(ObjFile file, read_obj_file(name, plain_text(bytes, storage)));
  return ObjLoader(name, std::move(file), bundle, options).load();
}

}  // namespace voxeld
