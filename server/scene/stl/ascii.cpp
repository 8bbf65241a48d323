#include <bit>
#include <string>

#include "proto/client_texts.h"
#include "proto/limits.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/core/vertex_table.h"
#include "server/scene/stl/stl.h"

namespace voxeld {
namespace {

class StlTextReader {
 public:
  StlTextReader(std::string_view name, std::string_view text) : name_(name), cursor_(text) {}

  Result<Scene> read() {
    scene_.format = "stl";
    for (std::string_view word = cursor_.token(); !word.empty(); word = cursor_.token()) {
      if (!equals_ignoring_case(word, "solid")) return unexpected("\"solid\"", word);
      VOXELD_TRY(read_solid());
    }
    if (triangle_count_ == 0) return empty_mesh(name_, "no facets");
    if (scene_.parts.back().indices.empty()) scene_.parts.pop_back();
    name_meshes();
    return std::move(scene_);
  }

 private:
  Error unexpected(std::string expected, std::string_view word) const {
    return malformed_line(name_, cursor_.line(), "wrong word", std::move(expected), shown(word));
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

  Status read_solid() {
    const std::string_view solid_name = cursor_.rest_of_line();
    // An empty solid is valid but has no surface, so the next one replaces it.
    const bool reuse = !scene_.parts.empty() && (scene_.parts.back().indices.empty() ||
                                                 scene_.parts.size() == kScenePartsMax);
    if (!reuse) {
      scene_.parts.emplace_back();
      table_ = VertexTable();
    }
    MeshPart& part = scene_.parts.back();
    if (part.indices.empty()) {
      part.name = solid_name;
    } else {
      scene_.parts_merged = true;
    }
    for (;;) {
      const std::string_view word = cursor_.token();
      if (equals_ignoring_case(word, "endsolid")) break;
      if (!equals_ignoring_case(word, "facet")) {
        return unexpected("\"facet\" or \"endsolid\"", word);
      }
      VOXELD_TRY(read_facet(part));
    }
    cursor_.rest_of_line();
    return {};
  }

  Status expect(std::string_view keyword) {
    const std::string_view word = cursor_.token();
    if (equals_ignoring_case(word, keyword)) return {};
    return unexpected(echoed(keyword), word);
  }

  Status read_facet(MeshPart& part) {
    // Skips "normal x y z"; some writers omit words and others write "nan".
    constexpr int kNormalWordsMax = 4;
    for (int i = 0; i < kNormalWordsMax; ++i) {
      if (equals_ignoring_case(cursor_.token(), "outer")) return read_loop(part);
    }
    VOXELD_TRY(expect("outer"));
    return read_loop(part);
  }

  Status read_loop(MeshPart& part) {
    if (++triangle_count_ > limits::kTrianglesMax) {
      return over_limit(name_, "line " + std::to_string(cursor_.line()), "too many triangles",
                        limits::kTrianglesMax, triangle_count_);
    }
    VOXELD_TRY(expect("loop"));
    for (int corner = 0; corner < 3; ++corner) {
      VOXELD_TRY(expect("vertex"));
      VOXELD_TRY(read_vertex(part));
    }
    VOXELD_TRY(expect("endloop"));
    return expect("endfacet");
  }

  // Rounds positions to float, the type of binary STL, so the text and the binary form of a mesh
  // give the same vertices.
  Status read_vertex(MeshPart& part) {
    glm::dvec3 p;
    VertexTable::Key key{};
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = cursor_.token();
      const auto number = parse_number(word);
      if (!number || !is_coordinate(*number)) {
        return malformed_line(name_, cursor_.line(), "vertex coordinate",
                              "a finite number up to 1e30", shown(word));
      }
      const auto x = static_cast<float>(*number);
      p[axis] = x;
      // -0 and 0 are the same position.
      key[static_cast<size_t>(axis)] = x == 0.0f ? 0 : std::bit_cast<uint32_t>(x);
    }
    const auto next = static_cast<uint32_t>(part.positions.size());
    const auto [index, is_new] = table_.find_or_add(key, next);
    if (is_new) part.positions.push_back(p);
    part.indices.push_back(index);
    return {};
  }

  std::string_view name_;
  TextCursor cursor_;
  VertexTable table_;  // of the current solid
  int64_t triangle_count_ = 0;
  Scene scene_;
};

}  // namespace

Result<Scene> load_stl_ascii(std::string_view name, std::string_view text) {
  return StlTextReader(name, text).read();
}

}  // namespace voxeld
