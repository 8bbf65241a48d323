// Reads OFF as text. '#' starts a comment. The counts may follow the keyword without a blank, as in
// ModelNet's "OFF8 6 0"; a file may also begin with the counts.
//
// Geomview reads vertices word by word and takes the rest of a face's line as its colour. Many
// programs also write colours behind the vertices of a plain "OFF". A vertex is therefore the first
// numbers of its line, and further columns are its colour. A file is read word by word only if it
// has fewer lines than vertices and faces, or if its first vertex takes several lines.
#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/off/off.h"

namespace voxeld {
namespace {

// The most columns of a vertex: position, normal, colour and texture coordinate.
constexpr size_t kVertexColumnsMax = 3 + 3 + kOffColorComponentsMax + 2;
// Bytes of the shortest lines, "0 0 0\n" and "0\n".
constexpr int64_t kTextVertexBytesMin = 6, kTextFaceBytesMin = 2;

using Words = std::span<const std::string_view>;

class OffTextReader {
 public:
  OffTextReader(std::string_view name, std::string_view text)
      : name_(name), cursor_(text, '#'), mesh_(name) {}

  Result<Scene> read() {
    VOXELD_TRY(read_header());
    mesh_.part.positions.reserve(static_cast<size_t>(vertex_count_));
    const bool by_lines = has_whole_vertex() && has_lines(vertex_count_ + face_count_);
    for (int64_t i = 0; i < vertex_count_; ++i) {
      VOXELD_TRY(by_lines ? read_vertex_line(i) : read_vertex_words(i));
    }
    // Columns under a plain header may not be colours after all.
    if (!prefixes_.color && mesh_.vertex_colors.drop_impossible()) {
      mesh_.odd_vertex_columns = assumed_colors_;
    }
    VOXELD_TRY(read_faces());
    const std::string_view word = cursor_.token();
    if (!word.empty()) {
      return malformed(
          "text after the last face",
          "the end of the file, as the header declares " + std::to_string(face_count_) + " faces",
          word);
    }
    return mesh_.take_scene();
  }

 private:
  std::string where() const { return "line " + std::to_string(cursor_.line()); }

  Error malformed(std::string_view what, std::string expected, std::string_view got) const {
    return malformed_line(name_, cursor_.line(), what, std::move(expected), shown(got));
  }

  Status read_header() {
    std::string_view word = cursor_.token();
    const size_t off = word.find("OFF");
    if (off != word.npos) {
      VOXELD_ASSIGN(prefixes_, off_prefixes(name_, cursor_.line(), word));
      word = word.substr(off + 3);
      if (word.empty()) word = cursor_.token();
    }
    VOXELD_TRY(read_count(word, "vertices", limits::kVerticesMax, vertex_count_));
    VOXELD_TRY(read_count(cursor_.token(), "faces", limits::kTrianglesMax, face_count_));
    // The number of edges is never used, and some writers omit it.
    cursor_.token_on_line();
    const int64_t left = static_cast<int64_t>(cursor_.bytes_left()) + 1;
    const int64_t needed = kTextVertexBytesMin * vertex_count_ + kTextFaceBytesMin * face_count_;
    if (needed > left) {
      return off_truncated(name_, where(), vertex_count_, face_count_, needed, left - 1);
    }
    return {};
  }

  Status read_count(std::string_view word, std::string_view what, int64_t limit, int64_t& count) {
    const auto number = parse_integer(word);
    if (!number || *number < 0) {
      return malformed("number of " + std::string(what), "a whole number from 0", word);
    }
    count = *number;
    return check_off_count(name_, where(), what, count, limit);
  }

  // Whether `count` lines with content follow.
  bool has_lines(int64_t count) const {
    TextCursor ahead = cursor_;
    for (; count > 0; --count) {
      if (ahead.token().empty()) return false;
      ahead.rest_of_line();
    }
    return true;
  }

  // Whether the next line has all columns of a vertex.
  bool has_whole_vertex() const {
    TextCursor ahead = cursor_;
    size_t count = ahead.token().empty() ? 0 : 1;
    while (!ahead.token_on_line().empty()) ++count;
    return count >= bare_columns() + (prefixes_.color ? 3 : 0);
  }

  // The number of columns of a vertex without its colour.
  size_t bare_columns() const { return 3 + (prefixes_.normal ? 3 : 0) + (prefixes_.uv ? 2 : 0); }

  Status read_vertex_line(int64_t vertex) {
    std::array<std::string_view, kVertexColumnsMax> words;
    size_t count = 0;
    for (std::string_view word = cursor_.token(); !word.empty(); word = cursor_.token_on_line()) {
      if (count < words.size()) words[count] = word;
      ++count;
    }
    const size_t bare = bare_columns(), least = bare + (prefixes_.color ? 3 : 0);
    if (count < least) {
      return malformed_line(name_, cursor_.line(), "vertex " + std::to_string(vertex),
                            "at least " + std::to_string(least) + " numbers on its line",
                            std::to_string(count));
    }
    const size_t further = count - bare;
    size_t color_size = further == 3 ? 3 : 4;
    if (!prefixes_.color) {
      // With texture coordinates the place of the colour would be ambiguous, and no program is
      // known to write both.
      const bool is_color = (further == 3 || further == 4) && !prefixes_.uv;
      if (!is_color) color_size = 0;
    }
    if (further > color_size) mesh_.odd_vertex_columns.add(where());
    return add_vertex(vertex, {words.data(), std::min(bare + color_size, words.size())},
                      color_size);
  }

  // Reads a vertex word by word. Its colour has four numbers, as in Geomview.
  Status read_vertex_words(int64_t vertex) {
    std::array<std::string_view, kVertexColumnsMax> words;
    const size_t color_size = prefixes_.color ? 4 : 0;
    const size_t count = bare_columns() + color_size;
    for (size_t i = 0; i < count; ++i) words[i] = cursor_.token();
    return add_vertex(vertex, {words.data(), count}, color_size);
  }

  // `words`: position, normal, colour, texture coordinate.
  Status add_vertex(int64_t vertex, Words words, size_t color_size) {
    glm::dvec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = words[static_cast<size_t>(axis)];
      const auto number = parse_number(word);
      if (!number || !is_coordinate(*number)) {
        return malformed("vertex " + std::to_string(vertex), "a finite number up to 1e30", word);
      }
      position[axis] = *number;
    }
    words = words.subspan(3);
    mesh_.part.positions.push_back(position);
    if (prefixes_.normal) {
      std::array<float, 3> n{};
      VOXELD_TRY(read_values("normal", vertex, words.first(3), mesh_.bad_normals, n));
      mesh_.part.normals.emplace_back(n[0], n[1], n[2]);
      words = words.subspan(3);
    }
    if (color_size > 0) {
      VOXELD_TRY(read_vertex_color(vertex, words.first(color_size)));
      words = words.subspan(color_size);
    }
    if (prefixes_.uv) {
      std::array<float, 2> uv{};
      VOXELD_TRY(read_values("texture coordinate", vertex, words.first(2), mesh_.bad_uvs, uv));
      mesh_.part.uvs.emplace_back(uv[0], 1.0f - uv[1]);
    }
    return {};
  }

  // Reads numbers; all become zero if one of them is not finite.
  Status read_values(std::string_view what, int64_t vertex, Words words, OffCount& bad,
                     std::span<float> values) {
    bool finite = true;
    for (size_t i = 0; i < words.size(); ++i) {
      const auto number = parse_number_or_nan(words[i]);
      if (!number) {
        return malformed(std::string(what) + " of vertex " + std::to_string(vertex), "numbers",
                         words[i]);
      }
      finite = finite && is_coordinate(*number);
      values[i] = static_cast<float>(*number);
    }
    if (finite) return {};
    bad.add(where());
    std::fill(values.begin(), values.end(), 0.0f);
    return {};
  }

  Status read_vertex_color(int64_t vertex, Words words) {
    const auto color = color_of(words);
    if (color) {
      mesh_.vertex_colors.set(static_cast<size_t>(vertex), 1, *color);
      if (!prefixes_.color) assumed_colors_.add(where());
    } else if (prefixes_.color) {
      const auto* const wrong = std::find_if(words.data(), words.data() + words.size(),
                                             [](auto word) { return !parse_number_or_nan(word); });
      return malformed("colour of vertex " + std::to_string(vertex), "numbers", *wrong);
    } else {
      mesh_.odd_vertex_columns.add(where());
    }
    return {};
  }

  // The colour in `words`: kNone, and counted, if a number is not finite; nullopt for other words.
  std::optional<OffColor> color_of(Words words) {
    OffColor color{.kind = OffColor::kWhole, .has_alpha = words.size() == 4};
    bool finite = true;
    for (size_t i = 0; i < words.size(); ++i) {
      const auto number = parse_number_or_nan(words[i]);
      if (!number) return std::nullopt;
      finite = finite && is_coordinate(*number);
      color.rgba[static_cast<int>(i)] = static_cast<float>(*number);
      if (words[i].find_first_of(".eE") != words[i].npos) color.kind = OffColor::kFraction;
    }
    if (finite) return color;
    mesh_.bad_colors.add(where());
    return OffColor{};
  }

  Status read_faces() {
    mesh_.part.indices.reserve(static_cast<size_t>(face_count_) * 3);
    for (int64_t i = 0; i < face_count_; ++i) {
      const std::string_view word = cursor_.token();
      const auto size = parse_integer(word);
      if (!size || *size < 0) {
        return malformed("face " + std::to_string(i), "its number of corners", word);
      }
      if (*size > limits::kPolygonCornersMax) {
        return over_limit(name_, where(), "too many corners of a face", limits::kPolygonCornersMax,
                          *size);
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
                         index_range(vertex_count_, "vertices"), word);
      }
      corners_.push_back(static_cast<uint32_t>(*index));
    }
    return mesh_.add_face(corners_, read_face_color());
  }

  // Reads the rest of the face's line as its colour.
  OffColor read_face_color() {
    std::array<std::string_view, kOffColorComponentsMax> words;
    size_t count = 0;
    for (std::string_view word = cursor_.token_on_line(); !word.empty();
         word = cursor_.token_on_line()) {
      if (count < words.size()) words[count] = word;
      ++count;
    }
    if (count == 0) return {};
    if (count == 3 || count == 4) {
      if (const auto color = color_of({words.data(), count})) return *color;
    }
    if (count == 1 && parse_integer(words[0])) {
      ++mesh_.mapped_color_count;
    } else {
      mesh_.odd_face_columns.add(where());
    }
    return {};
  }

  std::string_view name_;
  TextCursor cursor_;
  OffMesh mesh_;
  OffPrefixes prefixes_;
  int64_t vertex_count_ = 0, face_count_ = 0;
  OffCount assumed_colors_;  // of vertices, under a header without colours
  std::vector<uint32_t> corners_;
};

}  // namespace

Result<Scene> load_off_text(std::string_view name, std::string_view text) {
  return OffTextReader(name, text).read();
}

}  // namespace voxeld
