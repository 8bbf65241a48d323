// OFF, Geomview's object file format, as text:
//
//   [ST][C][N]OFF           the prefixes say what follows a vertex's position, in the order
//   vertices faces edges    normal (3), colour (3 or 4), texture coordinate (2)
//   x y z ...
//   n i0 i1 ... [colour]    1 number: index of a colour map, dropped; 3 or 4: a colour
//
// '#' starts a comment. Colours are taken as sRGB: integers from 0 to 255, or, where any of a
// colour's numbers has a point or exponent, from 0 to 1. The counts may follow the keyword without
// a blank, as in ModelNet's "OFF8 6 0". A file may also begin with the counts.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <glm/geometric.hpp>

#include "proto/limits.h"
#include "server/scene/color_space.h"
#include "server/scene/load.h"
#include "server/scene/mesh_error.h"
#include "server/scene/polygon_sink.h"
#include "server/scene/text_cursor.h"

namespace voxeld {
namespace {

constexpr size_t kColorComponentsMax = 4;

class OffReader {
 public:
  OffReader(std::string_view name, std::string_view text)
      : name_(name), cursor_(text, '#'), sink_(name) {}

  Result<Scene> read() {
    VOXELD_TRY(read_header());
    VOXELD_TRY(read_vertices());
    VOXELD_TRY(read_faces());
    if (part_.indices.empty()) return empty_mesh(name_, "no faces");
    Scene scene;
    scene.format = "off";
    warn_skipped_faces(scene, name_, skipped_face_count_);
    if (mapped_color_count_ > 0) {
      add_warning(scene, "ignored-colors",
                  std::string(name_) + ": " + std::to_string(mapped_color_count_) +
                      " faces with an index into a colour map; voxeld has none");
    }
    const bool by_face = any_face_color_ && part_.colors.empty();
    scene.parts.push_back(by_face ? with_triangle_colors(part_, triangle_colors_)
                                  : std::move(part_));
    return scene;
  }

 private:
  Error malformed(std::string_view what, std::string expected, std::string_view got) const {
    return malformed_line(name_, cursor_.line(), what, std::move(expected), shown(got));
  }
  Error unsupported(std::string_view what) const {
    return {
        ErrorCode::kUnsupportedFeature,
        std::string(name_) + " line " + std::to_string(cursor_.line()) + ": " + std::string(what),
        "OFF as text, with the prefixes ST, C and N", ""};
  }

  Status read_header() {
    std::string_view word = cursor_.token();
    const size_t off = word.find("OFF");
    if (off != word.npos) {
      VOXELD_TRY(read_prefixes(word.substr(0, off), word));
      word = word.substr(off + 3);
      if (word.empty()) word = cursor_.token();
    }
    if (word == "BINARY") return unsupported("OFF BINARY");
    VOXELD_TRY(read_count(word, "vertices", limits::kVerticesMax, vertex_count_));
    VOXELD_TRY(read_count(cursor_.token(), "faces", limits::kTrianglesMax, face_count_));
    // The number of edges is never used; some writers leave it out.
    cursor_.token_on_line();
    // A vertex takes 6 bytes at least, "0 0 0\n"; a face 2, "0\n".
    const auto left = static_cast<int64_t>(cursor_.bytes_left()) + 1;
    if (vertex_count_ > left / 6 || face_count_ > (left - 6 * vertex_count_) / 2) {
      return malformed_line(
          name_, cursor_.line(),
          "truncated: " + std::to_string(vertex_count_) + " vertices and " +
              std::to_string(face_count_) + " faces declared",
          "at least " + std::to_string(6 * vertex_count_ + 2 * face_count_) + " bytes",
          std::to_string(left - 1) + " bytes left");
    }
    return {};
  }

  Status read_prefixes(std::string_view prefixes, std::string_view word) {
    if (prefixes.substr(0, 2) == "ST") {
      has_uv_ = true;
      prefixes.remove_prefix(2);
    }
    if (prefixes.substr(0, 1) == "C") {
      has_color_ = true;
      prefixes.remove_prefix(1);
    }
    if (prefixes.substr(0, 1) == "N") {
      has_normal_ = true;
      prefixes.remove_prefix(1);
    }
    if (prefixes.empty()) return {};
    if (prefixes == "4" || prefixes == "n" || prefixes == "4n") {
      return unsupported(std::string(word.substr(0, word.find("OFF") + 3)) +
                         ": points with other than 3 coordinates");
    }
    return malformed("wrong keyword", "OFF with the prefixes ST, C and N", word);
  }

  Status read_count(std::string_view word, std::string_view what, int64_t limit, int64_t& count) {
    const auto number = parse_integer(word);
    if (!number || *number < 0) {
      return malformed("number of " + std::string(what), "a whole number from 0", word);
    }
    if (*number > limit) {
      return over_limit(name_, "line " + std::to_string(cursor_.line()),
                        "too many " + std::string(what), limit, *number);
    }
    count = *number;
    return {};
  }

  Status read_numbers(int64_t vertex, std::span<double> values) {
    for (double& value : values) {
      const std::string_view word = cursor_.token();
      const auto number = parse_number(word);
      if (!number || !is_coordinate(*number)) {
        return malformed("vertex " + std::to_string(vertex), "a finite number up to 1e30", word);
      }
      value = *number;
    }
    return {};
  }

  Status read_vertices() {
    part_.positions.reserve(static_cast<size_t>(vertex_count_));
    for (int64_t i = 0; i < vertex_count_; ++i) {
      std::array<double, 3> p{};
      VOXELD_TRY(read_numbers(i, p));
      part_.positions.emplace_back(p[0], p[1], p[2]);
      if (has_normal_) {
        VOXELD_TRY(read_numbers(i, p));
        const glm::vec3 n(p[0], p[1], p[2]);
        normals_valid_ &= glm::dot(n, n) > 0.0f && glm::dot(n, n) < 1e30f;
        part_.normals.push_back(normals_valid_ ? glm::normalize(n) : n);
      }
      if (has_color_) VOXELD_TRY(read_vertex_color(i));
      if (has_uv_) {
        std::array<double, 2> uv{};
        VOXELD_TRY(read_numbers(i, uv));
        part_.uvs.emplace_back(static_cast<float>(uv[0]), static_cast<float>(1.0 - uv[1]));
      }
    }
    if (!normals_valid_) part_.normals.clear();
    return {};
  }

  // Three numbers or four: the first vertex tells, by what is left on its line.
  Status read_vertex_color(int64_t vertex) {
    if (color_size_ == 0) {
      TextCursor ahead = cursor_;
      size_t count = 0;
      while (!ahead.token_on_line().empty()) ++count;
      color_size_ = count == (has_uv_ ? 5u : 3u) ? 3 : 4;
    }
    std::array<std::string_view, kColorComponentsMax> words;
    for (size_t i = 0; i < color_size_; ++i) words[i] = cursor_.token();
    const auto color = color_of({words.data(), color_size_});
    if (!color) {
      return malformed("colour of vertex " + std::to_string(vertex), "numbers",
                       words[color_size_ - 1]);
    }
    part_.colors.push_back(*color);
    return {};
  }

  static std::optional<glm::vec4> color_of(std::span<const std::string_view> words) {
    glm::vec4 color(0.0f, 0.0f, 0.0f, 1.0f);
    bool unit = false;
    for (size_t i = 0; i < words.size(); ++i) {
      const auto number = parse_number(words[i]);
      if (!number) return std::nullopt;
      color[static_cast<int>(i)] = static_cast<float>(*number);
      unit |= words[i].find_first_of(".eE") != std::string_view::npos;
    }
    if (!unit) {
      color = glm::vec4(glm::vec3(color) / 255.0f, words.size() == 4 ? color.w / 255.0f : 1.0f);
    }
    return glm::vec4(linear_from_srgb(glm::vec3(color)), unit_clamped(color.w));
  }

  Status read_faces() {
    part_.indices.reserve(static_cast<size_t>(face_count_) * 3);
    for (int64_t i = 0; i < face_count_; ++i) {
      const std::string_view word = cursor_.token();
      const auto size = parse_integer(word);
      if (!size || *size < 0) {
        return malformed("face " + std::to_string(i), "its number of corners", word);
      }
      if (*size > limits::kPolygonCornersMax) {
        return over_limit(name_, "line " + std::to_string(cursor_.line()),
                          "too many corners of a face", limits::kPolygonCornersMax, *size);
      }
      VOXELD_TRY(read_face(i, *size));
    }
    return {};
  }

  Status read_face(int64_t number, int64_t size) {
    corners_.clear();
    for (int64_t k = 0; k < size; ++k) {
      const std::string_view word = cursor_.token();
      const auto index = parse_integer(word);
      if (!index || *index < 0 || *index >= vertex_count_) {
        return malformed("face " + std::to_string(number) + ": vertex index out of range",
                         vertex_count_ == 0 ? "none, as there are no vertices"
                                            : "0.." + std::to_string(vertex_count_ - 1),
                         word);
      }
      corners_.push_back(static_cast<uint32_t>(*index));
    }
    const glm::vec4 color = read_face_color();
    if (size < 3) {
      ++skipped_face_count_;
      return {};
    }
    VOXELD_TRY(sink_.add_face(corners_, part_));
    // Faces before the first coloured one are white.
    if (any_face_color_)
      triangle_colors_.resize(part_.indices.size() / 3 - corners_.size() + 2, glm::vec4(1.0f));
    if (any_face_color_) triangle_colors_.resize(part_.indices.size() / 3, color);
    return {};
  }

  // What is left on the face's line; white where that is no colour.
  glm::vec4 read_face_color() {
    std::array<std::string_view, kColorComponentsMax> words;
    size_t count = 0;
    for (std::string_view word = cursor_.token_on_line(); !word.empty();
         word = cursor_.token_on_line()) {
      if (count < words.size()) words[count] = word;
      ++count;
    }
    if (count == 1) ++mapped_color_count_;
    if (count != 3 && count != 4) return glm::vec4(1.0f);
    const auto color = color_of({words.data(), count});
    any_face_color_ |= color.has_value();
    return color.value_or(glm::vec4(1.0f));
  }

  std::string_view name_;
  TextCursor cursor_;
  PolygonSink sink_;
  bool has_normal_ = false, has_color_ = false, has_uv_ = false;
  bool normals_valid_ = true;
  size_t color_size_ = 0;  // components of a vertex colour; 0: not known yet
  int64_t vertex_count_ = 0, face_count_ = 0;
  int64_t skipped_face_count_ = 0, mapped_color_count_ = 0;
  bool any_face_color_ = false;
  std::vector<glm::vec4> triangle_colors_;
  std::vector<uint32_t> corners_;
  MeshPart part_;
};

}  // namespace

Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes) {
  return OffReader(name, as_text(bytes)).read();
}

}  // namespace voxeld
