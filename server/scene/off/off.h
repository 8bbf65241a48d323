// OFF, Geomview's object file format: as text (off_text.cpp) and as binary (off_binary.cpp).
//
//   [ST][C][N]OFF           the prefixes say what follows a vertex's position, in the order
//   vertices faces edges    normal (3), colour (3 or 4), texture coordinate (2)
//   x y z ...
//   n i0 i1 ... [colour]    1 number: index of a colour map, dropped; 3 or 4: a colour
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/core/polygon_sink.h"
#include "server/scene/core/scene.h"

namespace voxeld {

struct OffPrefixes {
  bool normal = false, color = false, uv = false;
};

// A colour as written in the file. Its range is known only after all colours of the file.
struct OffColor {
  enum Kind : uint8_t { kNone, kWhole, kFraction };  // kWhole: written as integers
  glm::vec4 rgba{1.0f};
  Kind kind = kNone;
  bool has_alpha = false;
};

// The colours of all vertices or all triangles, taken as sRGB. Integers are 0..255, other numbers
// 0..1. A file without an integer above 1 means 0..1 ("1 0 0" is red), and one with a fraction
// clearly above 1 means 0..255. Geomview decides this for each face.
class OffColors {
 public:
  // Sets the colour of elements first..first+count-1. Elements before `first` may have none.
  void set(size_t first, size_t count, const OffColor& color);
  bool empty() const { return colors_.empty(); }
  // Drops all colours if one is below 0 or above 255.
  bool drop_impossible();
  // A linear colour for each of `count` elements; white if it has none.
  std::vector<glm::vec4> linear(size_t count) const;

 private:
  std::vector<OffColor> colors_;
  bool possible_ = true;
  float whole_max_ = 0.0f, fraction_max_ = 0.0f;
};

// Counts elements with something dropped, and remembers the place of the first ("line 3").
struct OffCount {
  int64_t count = 0;
  std::string first;
  void add(const std::string& where) {
    if (count++ == 0) first = where;
  }
};

// Collects the data of the readers and makes the scene.
struct OffMesh {
  explicit OffMesh(std::string_view file) : name(file), sink(file) {}

  // `corners`: each below the number of vertices.
  Status add_face(std::span<const uint32_t> corners, const OffColor& color);
  // Errors: empty-mesh.
  Result<Scene> take_scene();

  std::string_view name;
  PolygonSink sink;
  MeshPart part;  // without its colours; normals as written
  OffColors vertex_colors, triangle_colors;
  int64_t skipped_face_count = 0, mapped_color_count = 0;
  OffCount bad_normals, bad_uvs, bad_colors;      // NaN and infinities
  OffCount odd_vertex_columns, odd_face_columns;  // dropped
};

inline constexpr size_t kOffColorComponentsMax = 4;  // RGBA

// Checks a count of the header. `where`: "line 2". `limit`: from limits.h.
Status check_off_count(std::string_view name, const std::string& where, std::string_view what,
                       int64_t count, int64_t limit);
// The error for counts that the rest of the file cannot hold.
Error off_truncated(std::string_view name, const std::string& where, int64_t vertex_count,
                    int64_t face_count, int64_t needed_bytes, int64_t left_bytes);

// `data_offset`: the first byte after the keyword's line.
Result<Scene> load_off_text(std::string_view name, std::string_view text);
Result<Scene> load_off_binary(std::string_view name, std::span<const uint8_t> bytes,
                              size_t data_offset, const OffPrefixes& prefixes);

// Parses the prefixes of a first word such as "STCNOFF" or "OFF8". Errors: malformed-mesh for
// others, unsupported-feature for points with other than 3 coordinates.
Result<OffPrefixes> off_prefixes(std::string_view name, int64_t line, std::string_view word);

}  // namespace voxeld
