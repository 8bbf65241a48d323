#include <algorithm>
#include <bit>
#include <optional>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "proto/text/client_texts.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/core/vertex_table.h"
#include "server/scene/stl/stl.h"

namespace voxeld {
namespace {

enum class StlWord {
  kSolid,
  kFacet,
  kOuter,
  kLoop,
  kVertex,
  kEndLoop,
  kEndFacet,
  kEndSolid,
  kColor,
  kOther,
  kEndOfFile
};

StlWord stl_word(std::string_view word) {
  if (word.empty()) return StlWord::kEndOfFile;
  const auto first = static_cast<char>(word[0] | 0x20);  // in lower case
  if (first < 'a') return StlWord::kOther;               // most words are numbers
  const auto is = [&](std::string_view text) {
    return word.size() == text.size() && equals_ignoring_case(word, text);
  };
  switch (first) {
    case 'v':
      return is("vertex") ? StlWord::kVertex : StlWord::kOther;
    case 'f':
      return is("facet") ? StlWord::kFacet : StlWord::kOther;
    case 'o':
      return is("outer") || is("outerloop") ? StlWord::kOuter : StlWord::kOther;
    case 'l':
      return is("loop") ? StlWord::kLoop : StlWord::kOther;
    case 'e':
      if (is("endloop")) return StlWord::kEndLoop;
      if (is("endfacet")) return StlWord::kEndFacet;
      return is("endsolid") ? StlWord::kEndSolid : StlWord::kOther;
    case 's':
      return is("solid") ? StlWord::kSolid : StlWord::kOther;
    case 'c':
      return is("color") ? StlWord::kColor : StlWord::kOther;
    default:
      return StlWord::kOther;
  }
}

// A number as Fortran (1.0D+00) or a program under a locale with decimal commas writes it.
std::optional<double> parse_foreign_number(std::string_view word) {
  constexpr size_t kNumberBytesMax = 64;
  if (word.size() > kNumberBytesMax) return std::nullopt;
  std::string text(word);
  std::replace(text.begin(), text.end(), ',', '.');
  std::replace(text.begin(), text.end(), 'D', 'e');
  std::replace(text.begin(), text.end(), 'd', 'e');
  return parse_number(text);
}

class StlTextReader {
 public:
  StlTextReader(std::string_view name, std::string_view text) : name_(name), cursor_(text) {}

  Result<Scene> read() {
    scene_.format = "stl";
    next();
    while (known_ != StlWord::kEndOfFile) VOXELD_TRY(read_statement());
    if (triangle_count_ == 0) return no_facets();
    warn();
    if (scene_.parts.back().indices.empty()) scene_.parts.pop_back();
    name_meshes();
    return std::move(scene_);
  }

 private:
  struct Corner {
    glm::dvec3 position;
    BasicVertexTable<7>::Key key;
  };

  // Moves to the next word; "end" and what ends are one.
  void next() {
    word_ = cursor_.token();
    known_ = stl_word(word_);
    if (known_ != StlWord::kOther || !equals_ignoring_case(word_, "end")) return;
    TextCursor ahead = cursor_;
    const StlWord ended = stl_word(ahead.token());
    if (ended == StlWord::kLoop) known_ = StlWord::kEndLoop;
    if (ended == StlWord::kFacet) known_ = StlWord::kEndFacet;
    if (ended == StlWord::kSolid) known_ = StlWord::kEndSolid;
    if (known_ != StlWord::kOther) cursor_ = ahead;
  }

  Error unexpected(std::string expected) const {
    return malformed_line(name_, cursor_.line(), "wrong word", std::move(expected), shown(word_));
  }
  Status expect(StlWord known, std::string_view keyword) {
    if (known_ != known) return unexpected(echoed(keyword));
    next();
    return {};
  }

  // Whether the word has no meaning within a facet.
  bool is_foreign() const { return known_ == StlWord::kOther || known_ == StlWord::kColor; }

  void ignore_word() {
    if (++ignored_count_ == 1) {
      first_ignored_ = word_;
      first_ignored_line_ = cursor_.line();
    }
    next();
  }

  Error no_facets() const {
    constexpr std::string_view kWanted = "\"facet\" or \"endsolid\"";
    if (ignored_count_ > 0) {
      return malformed_line(name_, first_ignored_line_, "wrong word", std::string(kWanted),
                            shown(first_ignored_));
    }
    return in_solid_ ? unexpected(std::string(kWanted)) : empty_mesh(name_, "no facets");
  }

  void warn() {
    const std::string name(name_);
    if (ignored_count_ > 0) {
      add_warning(scene_, "ignored-words",
                  name + ": " + std::to_string(ignored_count_) +
                      " words between facets were left out, the first in line " +
                      std::to_string(first_ignored_line_) + ": " + shown(first_ignored_));
    }
    if (in_solid_ && !scene_.parts.back().indices.empty()) {
      add_warning(scene_, "missing-end",
                  name + ": no \"endsolid\" after the last of " + std::to_string(triangle_count_) +
                      " facets: the file may be cut off");
    }
  }

  // Makes each solid a mesh and a node.
  void name_meshes() {
    scene_.meshes.clear();
    for (MeshPart& part : scene_.parts) {
      part.mesh = part.node = static_cast<uint32_t>(scene_.meshes.size());
      scene_.meshes.push_back(part.name);
    }
    scene_.nodes = scene_.meshes;
  }

  Status read_statement() {
    switch (known_) {
      case StlWord::kFacet:
        if (!in_solid_) begin_solid("");
        return read_facet(scene_.parts.back());
      case StlWord::kSolid:
        begin_solid(rest_of_name(false));
        next();
        return {};
      case StlWord::kEndSolid:
        in_solid_ = false;
        rest_of_name(true);
        next();
        return {};
      case StlWord::kOuter:
      case StlWord::kVertex:
        return unexpected("\"facet\" or \"endsolid\"");
      default:
        if (!in_solid_ && triangle_count_ == 0) return unexpected("\"solid\"");
        ignore_word();
        return {};
    }
  }

  // The rest of the line, up to facets (and for `next_solid` up to a solid) that follow on it.
  std::string_view rest_of_name(bool next_solid) {
    TextCursor before = cursor_;
    const std::string_view first = cursor_.token_on_line();
    std::string_view last = first;
    for (std::string_view word = first; !word.empty(); word = cursor_.token_on_line()) {
      const StlWord known = stl_word(word);
      TextCursor ahead = cursor_;
      if ((known == StlWord::kSolid && next_solid) ||
          (known == StlWord::kFacet && equals_ignoring_case(ahead.token_on_line(), "normal"))) {
        cursor_ = before;
        if (word.data() == first.data()) return {};
        break;
      }
      before = cursor_;
      last = word;
    }
    return {first.data(), static_cast<size_t>(last.data() + last.size() - first.data())};
  }

  void begin_solid(std::string_view solid_name) {
    in_solid_ = true;
    // An empty solid is valid but has no surface, so the next one replaces it.
    const bool reuse = !scene_.parts.empty() && (scene_.parts.back().indices.empty() ||
                                                 scene_.parts.size() == kScenePartsMax);
    if (!reuse) {
      scene_.parts.emplace_back();
      table_ = BasicVertexTable<7>();
    }
    MeshPart& part = scene_.parts.back();
    if (part.indices.empty()) {
      part.name = solid_name;
    } else {
      scene_.parts_merged = true;
    }
  }

  Status read_facet(MeshPart& part) {
    // Skips "normal x y z"; some writers omit words and others write "nan".
    constexpr int kNormalWordsMax = 4;
    int words = 0;
    for (next(); known_ == StlWord::kOther && words < kNormalWordsMax; ++words) next();
    while (is_foreign()) ignore_word();
    VOXELD_TRY(expect(StlWord::kOuter, "outer"));
    if (known_ == StlWord::kLoop) next();
    if (++triangle_count_ > limits::kTrianglesMax) {
      return over_limit(name_, "line " + std::to_string(cursor_.line()), "too many triangles",
                        limits::kTrianglesMax, triangle_count_);
    }
    Corner corners[3];
    for (Corner& corner : corners) {
      if (known_ != StlWord::kVertex) return unexpected("\"vertex\"");
      VOXELD_TRY(read_vertex(corner));
      next();
      while (is_foreign()) ignore_word();
    }
    VOXELD_TRY(expect(StlWord::kEndLoop, "endloop"));
    VOXELD_TRY(expect(StlWord::kEndFacet, "endfacet"));
    add_facet(part, corners, read_color());
    return {};
  }

  Status read_vertex(Corner& corner) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const std::string_view word = cursor_.token();
      auto number = parse_number(word);
      if (!number) number = read_foreign_number(word);
      if (!number || !is_coordinate(*number)) {
        return malformed_line(name_, cursor_.line(), "vertex coordinate",
                              "a finite number up to 1e30", shown(word));
      }
      corner.position[static_cast<int>(axis)] = *number;
      // -0 and 0 are the same position.
      const uint64_t bits = *number == 0.0 ? 0 : std::bit_cast<uint64_t>(*number);
      corner.key[2 * axis] = static_cast<uint32_t>(bits);
      corner.key[2 * axis + 1] = static_cast<uint32_t>(bits >> 32);
    }
    return {};
  }

  std::optional<double> read_foreign_number(std::string_view word) {
    const auto number = parse_foreign_number(word);
    if (number && !commas_warned_ && word.find(',') != word.npos) {
      commas_warned_ = true;
      add_warning(scene_, "decimal-commas",
                  std::string(name_) + " line " + std::to_string(cursor_.line()) + ": " +
                      shown(word) + " and the like were read with a comma as the decimal point");
    }
    return number;
  }

  // The number of "color N" after a facet: the attribute of a binary file, in VisCAM's order (after
  // MeshLab's issue 1423); nullopt if there is none. The bit 15 is not needed here.
  std::optional<uint32_t> read_color() {
    if (known_ != StlWord::kColor) return std::nullopt;
    TextCursor ahead = cursor_;
    const auto number = parse_integer(ahead.token_on_line());
    const bool is_alone = stl_word(TextCursor(ahead).token_on_line()) != StlWord::kOther;
    if (!number || *number < 0 || *number > UINT16_MAX || !is_alone) return std::nullopt;
    cursor_ = ahead;
    next();
    return static_cast<uint32_t>(*number) & 0x7fff;
  }

  void add_facet(MeshPart& part, Corner (&corners)[3], std::optional<uint32_t> color) {
    const bool is_colored = color || !part.colors.empty();
    if (color && part.colors.empty()) {
      resize_in_pieces(part.colors, part.positions.size(), glm::vec4(1.0f));
    }
    for (Corner& corner : corners) {
      corner.key[6] = color ? *color | 0x8000 : 0;
      const auto index = static_cast<uint32_t>(part.positions.size());
      const auto [found, is_new] = table_.find_or_add(corner.key, index);
      push_in_pieces(part.indices, found);
      if (!is_new) continue;
      push_in_pieces(part.positions, corner.position);
      if (is_colored) push_in_pieces(part.colors, color ? stl_color(*color) : glm::vec4(1.0f));
    }
  }

  std::string_view name_;
  TextCursor cursor_;      // behind word_
  std::string_view word_;  // being read
  StlWord known_ = StlWord::kEndOfFile;
  bool in_solid_ = false;
  int64_t triangle_count_ = 0;
  int64_t ignored_count_ = 0;
  std::string_view first_ignored_;
  int64_t first_ignored_line_ = 0;
  bool commas_warned_ = false;
  BasicVertexTable<7> table_;  // of the current solid: three doubles and the colour
  Scene scene_;
};

}  // namespace

Result<Scene> load_stl_ascii(std::string_view name, std::string_view text) {
  return StlTextReader(name, text).read();
}

}  // namespace voxeld
